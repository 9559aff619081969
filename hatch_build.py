"""Puts the studies into a wheel as the package `symtop_studies`; an editable install reads them where they are."""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class StudiesHook(BuildHookInterface):
    """Adds the folder to the files of an ordinary wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """`version` is "editable" for a development install: a copy there would go out of date."""
        if version != "editable":
            build_data["force_include"]["studies"] = "symtop_studies"
