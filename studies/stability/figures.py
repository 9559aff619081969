"""The figures of the stability study with their captions: the atlas, a page a family of methods, and the mechanisms."""

import xarray as xr

from symtop.runner.study import Picture

from .atlas import families, pages
from .atlas_figures import atlas_page
from .atlas_words import all_advice, page_caption
from .mechanism_figures import mechanism_panels
from .mechanism_words import horizons, poles
from .tables import MECHANISMS


def pictures(data: xr.Dataset) -> list[Picture]:
    """All figures that the dataset has something for."""
    drawn = []
    for family in families(data):
        lines = all_advice(data, family)
        sentences = {name: line.sentence for name, line in lines.items()}
        for page, names in pages(list(lines)).items():
            figure = atlas_page(data, family, names, sentences)
            caption = page_caption(data, family, page, names)
            drawn.append(Picture(f"atlas-{family}-{page}", figure, caption, f"Maps of outcomes: {', '.join(names)}."))
    if set(MECHANISMS) & set(map(str, data["scene"].values)):
        caption = "Six ways to fail, each measured alone. " + " ".join(poles(data) + horizons(data))
        alt = "Six panels: pole grazing, resonances, sleeping threshold, separatrix, sampling, solver tolerance."
        drawn.append(Picture("mechanisms", mechanism_panels(data), caption, alt))
    return drawn
