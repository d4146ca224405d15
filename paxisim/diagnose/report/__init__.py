"""Report: a diagnosis as one HTML page with pictures, made by `paxisim.diagnose.Diagnosis.report`.

`page` assembles the page and lists the kinds of pictures, and the other modules draw them. The report needs
matplotlib and jinja2 (the ``diagnose`` extra), but no display, pyplot or browser.
"""
