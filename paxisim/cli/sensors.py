"""The ``paxisim sensors`` command."""

from __future__ import annotations

import textwrap


def sensors(*, sources: bool = False) -> None:
    """List the sensors that can be simulated, and the device profiles that drive them.

    For example:

    paxisim sensors --sources

    Args:
        sources: Also print the source of each figure.
    """
    from paxisim.hw.profiles.load import known_profiles
    from paxisim.sensors import format_table, known_sensors

    print(format_table())
    simulated = {profile for product in known_sensors() for profile in product.profiles}
    others = ", ".join(name for name in known_profiles() if name not in simulated)
    print(textwrap.fill(f"Profiles of other parts, to drive only: {others}", 78, break_on_hyphens=False))
    print("For the part that a profile drives, and who tried it: paxisim device profiles")
    if not sources:
        print("For the source of each figure, run: paxisim sensors --sources")
        return
    for product in known_sensors():
        print(f"\n{product.name}: {product.maker} {product.model}")
        for figure, source in product.sources.items():
            print(textwrap.fill(f"{figure}: {source}", 78, initial_indent="  ", subsequent_indent="    "))
        if product.notes:
            print(textwrap.fill(f"note: {product.notes}", 78, initial_indent="  ", subsequent_indent="    "))
