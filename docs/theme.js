// The site's switch between light and dark chooses the pictures too. Without this script, the system's setting does.
const choose = () => {
  const dark = document.body.dataset.mdColorScheme === "slate";
  for (const source of document.querySelectorAll("picture source")) source.media = dark ? "all" : "not all";
};
choose();
new MutationObserver(choose).observe(document.body, { attributeFilter: ["data-md-color-scheme"] });
