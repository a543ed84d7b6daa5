"""The JSON Schemas that ship, made from the classes of the file formats: ``make schemas``."""

from __future__ import annotations

import json

from symgrasp.cli.schema import SCHEMAS_DIR
from symgrasp.plan.plan import plan_schema
from symgrasp.scene.format import scene_schema
from symgrasp.survey.format import survey_schema

__all__ = ["schemas"]


def schemas() -> dict[str, str]:
    """Return what the files in `SCHEMAS_DIR` have to hold: name of the format → text."""
    found = {"scene": scene_schema(), "plan": plan_schema(), "survey": survey_schema()}
    return {name: json.dumps(schema, indent=2) + "\n" for name, schema in found.items()}


if __name__ == "__main__":
    for name, text in schemas().items():
        (SCHEMAS_DIR / f"{name}.schema.json").write_text(text, encoding="utf-8")
