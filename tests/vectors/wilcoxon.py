"""Makes the vectors that the paired tests are tested against: run `python3 tests/vectors/wilcoxon.py` with SciPy 1.17 and
statsmodels 0.15 installed.

`exact` counts sign patterns (without ties as SciPy does by itself; with ties over all patterns, after leaving out pairs without
a difference); `normal-approximation` is `scipy.stats.wilcoxon(d, method="asymptotic", correction=False)`.
"""

import json
import math
import pathlib

import numpy
from scipy.stats import PermutationMethod, wilcoxon
from statsmodels.stats.multitest import multipletests

HERE = pathlib.Path(__file__).parent


def waves(count, shift):
    """Differences without ties or zeros."""
    return [round(shift + math.sin(1.7 * index + 0.3) + 0.001 * index, 6) for index in range(count)]


def exact(differences):
    kept = numpy.array([value for value in differences if value != 0])
    if len(set(abs(kept))) == len(kept):
        return wilcoxon(kept, method="exact").pvalue
    return wilcoxon(kept, method=PermutationMethod(n_resamples=2 ** len(kept))).pvalue


CASES = {
    "four alike": [-0.1, -0.11, -0.12, -0.13],
    "one": [0.5],
    "nine": waves(9, 0.4),
    "sixteen": waves(16, 0.5),
    "fifty": waves(50, 0.2),
    "ties and zeros": [1, 1, 2, 2, 2, -1, 3, 0, 0, 4, -3, 5, 2, 1],
    "all tied": [1, 1, 1, -1, 1, 1, 1, 1],
}
MANY = {
    "fifty-one": waves(51, 0.2),
    "two hundred": waves(200, 0.05),
    "ties beyond fifty": [value for value in ([1, -2, 2, 3] * 15)],
}

cases = [
    {"name": name, "differences": d, "method": "exact", "p": float(exact(d))} for name, d in CASES.items()
] + [
    {
        "name": name,
        "differences": d,
        "method": "normal-approximation",
        "p": float(wilcoxon(d, method="asymptotic", correction=False).pvalue),
    }
    for name, d in MANY.items()
]
holm = [[0.01, 0.04, 0.03, 0.005], [0.2, 0.2, 0.9], [0.03], [1e-30, 0.5, 2e-3, 2e-3, 0.04]]
corrected = [{"p": p, "p_holm": [float(q) for q in multipletests(p, method="holm")[1]]} for p in holm]
(HERE / "wilcoxon.json").write_text(json.dumps({"cases": cases, "holm": corrected}, indent=1) + "\n")
