"""Rectangles of texels find places in as few atlases as they need."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["packed"]


def packed(sizes: Sequence[tuple[int, int]], side: int, most: int) -> list[tuple[int, int, int]] | None:
    """Find places of rectangles in at most so many square atlases.

    Parameters
    ----------
    sizes
        Width and height of each, texels, neither above `side`.
    side
        Texels along each side of an atlas.
    most
        How many atlases there may be.

    Returns
    -------
    list or None
        Number of the atlas, left and top of each rectangle; None where they do not fit.
    """
    import rectpack  # noqa: PLC0415 (nothing else needs it)

    if sum(width * height for width, height in sizes) > most * side * side:
        return None
    packer = rectpack.newPacker(
        mode=rectpack.PackingMode.Offline,
        bin_algo=rectpack.PackingBin.BFF,
        pack_algo=rectpack.GuillotineBssfSas,
        sort_algo=rectpack.SORT_SSIDE,
        rotation=False,
    )
    for row, (width, height) in enumerate(sizes):
        packer.add_rect(width, height, rid=row)
    packer.add_bin(side, side, count=most)
    packer.pack()
    places: list[tuple[int, int, int] | None] = [None] * len(sizes)
    for atlas, left, top, _, _, row in packer.rect_list():
        places[row] = (int(atlas), int(left), int(top))
    found = [place for place in places if place is not None]
    return found if len(found) == len(sizes) else None
