"""Which scenes a study runs: all that suit its question, a user's own included, but for those left out for a reason."""

from collections.abc import Callable, Iterable

from symtop.core.errors import one_of
from symtop.model.scenes import TAGS, Scene, scenes

ALL_BUT_TWO = {  # tags to leave out so that only spheroid and goldstein remain, with the reasons
    "ordinary": "spheroid and goldstein show it",
    "repeats": "spheroid and goldstein show the same",
    "fast": "two ordinary tops are enough",
    "steady": "two ordinary tops are enough",
    "unstable": "two ordinary tops are enough",
    "near_pole": "the angles chart fails",
}


def grid_scenes(left_out: Iterable[str] = (), suits: Callable[[Scene], bool] = lambda _: True) -> list[str]:
    """Names of the scenes of a study, in the order of the catalogue, a user's own at the end.

    Scenes with a tag in `left_out` (tags, or a mapping of tags to reasons) are not in the study, nor are those of which
    `suits` is false, because the question makes no sense for them. Raises SymtopError for an unknown tag.
    """
    tags = {one_of("left_out", tag, TAGS) for tag in left_out}
    return [name for name, scene in scenes().items() if not tags.intersection(scene.tags) and suits(scene)]
