"""What the documents show works: notebooks from the first cell to the last, and the README's examples."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
import pytest

from .conftest import ROOT

NOTEBOOKS = sorted((ROOT / "python" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_draws(notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    # As Jupyter does: its folder is searched for modules.
    monkeypatch.setattr(sys, "path", [str(notebook.parent), *sys.path])
    names: dict[str, object] = {"__name__": "__main__"}
    for number, cell in enumerate(json.loads(notebook.read_text())["cells"]):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [], "keep notebooks without outputs"
            exec(compile("".join(cell["source"]), f"{notebook.name}, cell {number}", "exec"), names)
    figures = [plt.figure(number) for number in plt.get_fignums()]
    assert figures
    for figure in figures:
        assert any(axes.has_data() for axes in figure.axes)
        figure.savefig(tmp_path / "figure.png")
    plt.close("all")
    if "PARFOCAL_FIGURES" in os.environ:
        shutil.copy(tmp_path / "figure.png", Path(os.environ["PARFOCAL_FIGURES"], f"{notebook.stem}.png"))
    folder = names["folder"]
    assert isinstance(folder, TemporaryDirectory)
    folder.cleanup()


def test_the_readmes_test_passes(pytester: pytest.Pytester) -> None:
    readme = (ROOT / "python" / "README.md").read_text()
    examples = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    tests = [example for example in examples if "def test_" in example]
    assert len(tests) == 1
    assert len(tests[0].splitlines()) <= 10
    pytester.makepyfile(tests[0])
    pytester.runpytest_subprocess("-p", "parfocal.pytest_plugin").assert_outcomes(passed=1)


def test_the_readmes_other_examples_are_python() -> None:
    readme = (ROOT / "python" / "README.md").read_text()
    for example in re.findall(r"```python\n(.*?)```", readme, re.DOTALL):
        compile(example, "README.md", "exec")
