"""Which scenes a study runs: all that suit its question, a user's own too, but for some, for a reason."""

from collections.abc import Callable, Iterable

from symtop.core.errors import one_of
from symtop.model.scenes import TAGS, Scene, scenes

ALL_BUT_TWO = {  # tags that leave spheroid and goldstein, with the reason
    "ordinary": "spheroid and goldstein show it",
    "repeats": "spheroid and goldstein show the same",
    "fast": "two ordinary tops are enough",
    "steady": "two ordinary tops are enough",
    "unstable": "two ordinary tops are enough",
    "near_pole": "the angles chart fails",
}


def grid_scenes(left_out: Iterable[str] = (), suits: Callable[[Scene], bool] = lambda _: True) -> list[str]:
    """Names of the scenes of a grid, in the order of the catalogue, a user's own at the end.

    Scenes with a tag that is `left_out` (a mapping of tags to reasons, say) are not in the study; `suits` says of a
    scene whether the question makes sense for it. Raises SymtopError for an unknown tag.
    """
    tags = {one_of("left_out", tag, TAGS) for tag in left_out}
    return [name for name, scene in scenes().items() if not tags.intersection(scene.tags) and suits(scene)]
