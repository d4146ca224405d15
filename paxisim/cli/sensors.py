"""``paxisim sensors``."""

from __future__ import annotations


def sensors(*, sources: bool = False) -> None:
    """List the known sensor products.

    For example:

    paxisim sensors --sources

    Args:
        sources: Also state where each figure comes from.
    """
    import textwrap

    from paxisim.sensors import format_table, known_sensors

    print(format_table())
    if not sources:
        print("Where each figure comes from: paxisim sensors --sources")
        return
    for product in known_sensors():
        print(f"\n{product.name}")
        for figure, source in product.sources.items():
            print(textwrap.fill(f"{figure}: {source}", 78, initial_indent="  ", subsequent_indent="    "))
        if product.notes:
            print(textwrap.fill(f"note: {product.notes}", 78, initial_indent="  ", subsequent_indent="    "))
