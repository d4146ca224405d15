"""The ``paxisim sensors`` command."""

from __future__ import annotations


def sensors(*, sources: bool = False) -> None:
    """List the known sensor products.

    For example:

    paxisim sensors --sources

    Args:
        sources: Also print the source of each figure.
    """
    import textwrap

    from paxisim.sensors import format_table, known_sensors

    print(format_table())
    if not sources:
        print("For the source of each figure, run: paxisim sensors --sources")
        return
    for product in known_sensors():
        print(f"\n{product.name}")
        for figure, source in product.sources.items():
            print(textwrap.fill(f"{figure}: {source}", 78, initial_indent="  ", subsequent_indent="    "))
        if product.notes:
            print(textwrap.fill(f"note: {product.notes}", 78, initial_indent="  ", subsequent_indent="    "))
