"""Reads a study's package as researchers would, with nothing of parfocal's, and prints what it finds as JSON.

usage: read_package.py PACKAGE
"""

import csv
import json
import re
import sys
from pathlib import Path

import duckdb
import polars
import pyreadstat

package = Path(sys.argv[1])
description = json.loads((package / "datapackage.json").read_text())


def plain(value):
    """What JSON can tell of a cell."""
    if hasattr(value, "isoformat"):
        return value.isoformat()
    if isinstance(value, float) and value != value:
        return None
    return value


found = {"parquet": {}, "polars": {}, "spss": {}, "formats": {}, "labels": {}, "values": {}}
for resource in description["resources"]:
    path = package / resource["path"]
    assert path.exists(), path
    if resource["format"] != "parquet":
        continue

    name = path.stem
    table = duckdb.sql(f"SELECT * FROM read_parquet('{path}')")
    assert table.columns == [field["name"] for field in resource["schema"]["fields"]], path
    found["parquet"][name] = [str(kind) for kind in table.types]
    frame = polars.read_parquet(path)
    found["polars"][name] = frame.height
    assert duckdb.sql(f"SELECT count(*) FROM read_parquet('{path}')").fetchall() == [(frame.height,)], path
    if name == "comments":
        found["comments"] = [dict(zip(frame.columns, map(plain, row))) for row in frame.rows()]

for path in sorted((package / "spss").glob("*.sav")):
    columns, meta = pyreadstat.read_sav(str(path), output_format="dict")
    found["spss"][path.stem] = len(next(iter(columns.values()))) if columns else 0
    found["formats"][path.stem] = meta.original_variable_types
    found["labels"][path.stem] = meta.column_names_to_labels
    found["values"][path.stem] = meta.variable_value_labels
    if path.stem == "comments":
        rows = zip(*columns.values())
        found["spss_comments"] = [dict(zip(columns, map(plain, row))) for row in rows]

# What REDCap checks of a data dictionary: https://redcap.link/datadictionary describes its 18 columns.
with open(package / "redcap/dictionary.csv", newline="", encoding="utf-8") as file:
    dictionary = list(csv.DictReader(file))
variables = [row["Variable / Field Name"] for row in dictionary]
assert all(re.fullmatch(r"[a-z][a-z0-9_]{0,99}", name) for name in variables), variables
assert len(set(variables)) == len(variables), "a variable is there twice"
assert {row["Field Type"] for row in dictionary} <= {"text", "notes", "truefalse"}, dictionary

with open(package / "redcap/import.csv", newline="", encoding="utf-8") as file:
    records = list(csv.DictReader(file))
assert set(records[0]) - {"redcap_repeat_instrument", "redcap_repeat_instance"} == set(variables)
found["redcap"] = {
    "records": sorted({record["record_id"] for record in records}),
    "comments": [r["comments_text"] for r in records if r["redcap_repeat_instrument"] == "comments"],
    "times": [r["sessions_wall"] for r in records if not r["redcap_repeat_instrument"]],
}
json.dump(found, sys.stdout, default=str)
