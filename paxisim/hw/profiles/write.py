"""A profile as the text of a TOML file."""

from __future__ import annotations

import json
from typing import Any

from paxisim.hw.profiles.profile import Profile


def profile_toml(profile: Profile) -> str:
    """Return the text of a profile file that `paxisim.load_profile` reads back as an equal profile."""
    lines = [
        '# A sensor profile for paxisim: paxisim.open_sensor(PORT, profile="THIS FILE"). Lengths in m, forces in N.',
        f"name = {_text(profile.name)}",
        f"family = {_text(profile.family)}",
        "# wire axis, with sign, of the pad's x, y and z",
        f"axes = [{', '.join(map(_text, profile.axes))}]",
        "# rows and columns of taxels summed to one",
        f"pool = [{profile.pool[0]}, {profile.pool[1]}]",
        f"resolution = {profile.resolution!r}",
        f"baud = {profile.baud}",
    ]
    if profile.rate is not None:
        lines.append(f"rate = {profile.rate!r}")
    lines += [
        "# who tried it, and on which device; empty: never tried",
        f"verified = {_text(profile.verified)}",
        f"notes = {_text(profile.notes)}",
        "",
        "[layout]",
    ]
    for key, value in profile.wire_layout.to_dict().items():
        if key == "vendor_order":
            lines.append("# row-major place of each taxel in the order of the bytes")
        lines.append(f"{key} = {_values(value)}")
    for slot in profile.slots:
        lines += ["", "[[slots]]", f"name = {_text(slot.name)}", f"index = {slot.index}"]
    for title, table in (("settings", profile.settings), ("sources", profile.sources)):
        if table:
            lines += ["", f"[{title}]", *(f"{_key(key)} = {_values(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _key(key: str) -> str:
    bare = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if bare else _text(key)


def _text(value: str) -> str:
    # TOML uses JSON's escapes, but also requires DEL to be escaped
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _values(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, (list, tuple)) and value and isinstance(value[0], (list, tuple)):
        return "[\n" + "".join(f"  {_values(row)},\n" for row in value) + "]"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_values, value))}]"
    return repr(value)
