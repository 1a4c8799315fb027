"""Makes the vectors that the analysis of studies is tested against: run `python3 tests/vectors/analysis.py` with SciPy
1.17 installed.

What SciPy has is SciPy's: `friedmanchisquare`, `page_trend_test`, `wilcoxon`, the F distribution, `rankdata`. Exact p
of Friedman's test, and of Page's with ties, are counted here over all permutations. The intraclass correlation is
computed from a two-way analysis of variance by its definition; the example of Shrout & Fleiss (1979) must give the 0.29
that they print, and the interval 0.019 to 0.76 that the manual of R's `psych::ICC` has for it.

Two studies are simulated: in one all policies are alike, in the other the third is better by far. The answers of a
third, small one are those that a test gives on a real server.
"""

import itertools
import json
import math
import pathlib
import random

import numpy
from scipy import stats

HERE = pathlib.Path(__file__).parent


def ranks(blocks):
    return numpy.array([stats.rankdata(block) for block in blocks])


def spread(sums):
    return float(((sums - sums.mean()) ** 2).sum())


def friedman_exact(blocks):
    """Share of all permutations of each block's ranks whose rank sums spread at least as far. The first block can stay
    as it is: permuting all blocks alike changes nothing."""
    own = ranks(blocks)
    observed = spread(own.sum(axis=0))
    orders = [list(itertools.permutations(block)) for block in own[1:]]
    found = [spread(own[0] + numpy.sum(choice, axis=0)) for choice in itertools.product(*orders)]
    return sum(value >= observed - 1e-9 for value in found) / len(found)


def friedman(name, blocks, exact=True):
    result = stats.friedmanchisquare(*zip(*blocks))
    n, k = len(blocks), len(blocks[0])
    return {
        "name": name,
        "blocks": blocks,
        "chi_square": float(result.statistic),
        "p_chi_square": float(result.pvalue),
        "p_exact": friedman_exact(blocks) if exact else None,
        "w": float(result.statistic) / (n * (k - 1)),
        "mean_ranks": ranks(blocks).mean(axis=0).tolist(),
    }


def page_counted(blocks):
    own = ranks(blocks)
    places = numpy.arange(1, own.shape[1] + 1)
    expected = len(blocks) * own.shape[1] * (own.shape[1] + 1) ** 2 / 4
    distance = abs(float((own @ places).sum()) - expected)
    sums = [[float(numpy.dot(order, places)) for order in itertools.permutations(block)] for block in own]
    found = [sum(choice) for choice in itertools.product(*sums)]
    return sum(abs(value - expected) >= distance - 1e-9 for value in found) / len(found)


def trend(name, blocks, method):
    data = numpy.array(blocks)
    if method == "counted":
        l = float((ranks(blocks) @ numpy.arange(1, data.shape[1] + 1)).sum())
        return {"name": name, "blocks": blocks, "l": l, "p": page_counted(blocks), "method": "exact"}
    rising = stats.page_trend_test(data, method=method)
    falling = stats.page_trend_test(data[:, ::-1], method=method)
    return {
        "name": name,
        "blocks": blocks,
        "l": float(rising.statistic),
        "p": min(1.0, 2 * min(rising.pvalue, falling.pvalue)),
        "method": "exact" if method == "exact" else "normal-approximation",
    }


def intraclass(subjects):
    """ICC(A,1) with McGraw and Wong's interval."""
    x = numpy.array(subjects, dtype=float)
    n, k = x.shape
    rows = x.mean(axis=1, keepdims=True)
    columns = x.mean(axis=0, keepdims=True)
    msr = k * ((rows - x.mean()) ** 2).sum() / (n - 1)
    msc = n * ((columns - x.mean()) ** 2).sum() / (k - 1)
    mse = ((x - rows - columns + x.mean()) ** 2).sum() / ((n - 1) * (k - 1))
    icc = (msr - mse) / (msr + (k - 1) * mse + k / n * (msc - mse))
    a = k * icc / (n * (1 - icc))
    b = 1 + k * icc * (n - 1) / (n * (1 - icc))
    v = (a * msc + b * mse) ** 2 / ((a * msc) ** 2 / (k - 1) + (b * mse) ** 2 / ((n - 1) * (k - 1)))
    below = stats.f.ppf(0.975, n - 1, v)
    above = stats.f.ppf(0.975, v, n - 1)
    low = n * (msr - below * mse) / (below * (k * msc + (k * n - k - n) * mse) + n * msr)
    high = n * (above * msr - mse) / (k * msc + (k * n - k - n) * mse + n * above * msr)
    return {"icc": float(icc), "low": float(low), "high": float(high)}


def agreement(name, subjects):
    return {"name": name, "subjects": subjects} | intraclass(subjects)


def summary(values):
    x = numpy.array(values, dtype=float)
    sd = float(x.std(ddof=1)) if len(x) > 1 else None
    return {"n": len(x), "mean": float(x.mean()), "median": float(numpy.median(x)), "sd": sd}


def signed_rank(a, b):
    d = numpy.array(a) - numpy.array(b)
    d[abs(d) < 1e-12] = 0
    kept = d[d != 0]
    own = stats.rankdata(abs(kept))
    positive = float(own[kept > 0].sum())
    negative = float(own[kept < 0].sum())
    expected = len(kept) * (len(kept) + 1) / 4
    # With ties: all patterns of signs, counted.
    patterns = [sum(own[place] for place in range(len(kept)) if bits >> place & 1) for bits in range(2 ** len(kept))]
    distance = abs(positive - expected)
    p = sum(abs(value - expected) >= distance - 1e-9 for value in patterns) / len(patterns)
    if len(set(own)) == len(own) and len(kept) > 0:
        assert math.isclose(p, stats.wilcoxon(kept, method="exact").pvalue, rel_tol=1e-9)
    return {
        "p": p,
        "differing": len(kept),
        "positive": positive,
        "negative": negative,
        "rank_biserial": (positive - negative) / (positive + negative) if len(kept) else None,
        "mean_difference": float(d.mean()),
    }


def holm(p):
    order = sorted(range(len(p)), key=p.__getitem__)
    corrected = [0.0] * len(p)
    least = 0.0
    for rank, index in enumerate(order):
        least = max(least, min(1.0, (len(p) - rank) * p[index]))
        corrected[index] = least
    return corrected


POLICIES = ["fixed", "mgm-hill-climber", "parfocal"]
REPEATS = 2


def simulate(name, effects, surgeons, seed):
    """Ratings of 1 to 7: a surgeon's own level, the policy's effect, noise; one surgeon left one question open."""
    source = random.Random(seed)
    sessions = []
    for number in range(surgeons):
        level = 4 + source.gauss(0, 0.7)
        order = POLICIES * REPEATS
        source.shuffle(order)
        settings = []
        for policy in order:
            rating = level + effects[policy] + source.gauss(0, 0.8)
            settings.append({"policy": policy, "value": min(7, max(1, round(rating)))})
        sessions.append({"surgeon": f"S-{number + 1:02}", "settings": settings})
    sessions[-1]["settings"][2]["value"] = None
    return {"name": name, "policies": POLICIES, "repeats": REPEATS, "sessions": sessions, "expected": analyse(sessions)}


def analyse(sessions):
    def of(session, policy):
        return [setting["value"] for setting in session["settings"] if setting["policy"] == policy]

    policies = []
    for policy in POLICIES:
        asked = [value for session in sessions for value in of(session, policy)]
        given = [value for value in asked if value is not None]
        policies.append({"policy": policy, "missing": len(asked) - len(given)} | summary(given))

    complete = [s for s in sessions if all(setting["value"] is not None for setting in s["settings"])]
    means = [[float(numpy.mean(of(session, policy))) for policy in POLICIES] for session in complete]
    result = stats.friedmanchisquare(*zip(*means))
    pairs = []
    for a, b in itertools.combinations(range(len(POLICIES)), 2):
        pair = signed_rank([row[a] for row in means], [row[b] for row in means])
        pairs.append({"a": POLICIES[a], "b": POLICIES[b]} | pair)
    for pair, corrected in zip(pairs, holm([pair["p"] for pair in pairs])):
        pair["p_holm"] = corrected

    positions = [[float(setting["value"]) for setting in session["settings"]] for session in complete]
    own = ranks(positions)
    k = own.shape[1]
    # Page's L with ties: the normal distribution's p, to be near the exact one.
    l = float((own @ numpy.arange(1, k + 1)).sum())
    deviation = l - len(own) * k * (k + 1) ** 2 / 4
    variance = sum(((row - row.mean()) ** 2).sum() for row in own) * k * (k + 1) / 12
    return {
        "policies": policies,
        "complete": len(complete),
        "friedman": {
            "chi_square": float(result.statistic),
            "p_chi_square": float(result.pvalue),
            "w": float(result.statistic) / (len(means) * (len(POLICIES) - 1)),
        },
        "pairs": pairs,
        "agreement": intraclass([of(session, policy) for session in complete for policy in POLICIES]),
        "trend": {"l": l, "p_near": float(2 * stats.norm.sf(abs(deviation) / math.sqrt(variance)))},
    }


# What three surgeons answer in the study that a test runs on a real server: to each policy, at its first and its second
# setting.
SMALL = {
    "S-01": {"fixed": [2, 3], "mgm-hill-climber": [4, 4], "mlr-hill-climber": [6, 7]},
    "S-02": {"fixed": [1, 1], "mgm-hill-climber": [3, 5], "mlr-hill-climber": [5, 5]},
    "S-03": {"fixed": [3, 2], "mgm-hill-climber": [2, 4], "mlr-hill-climber": [7, 6]},
}


def small():
    names = list(next(iter(SMALL.values())))
    means = [[float(numpy.mean(answers[policy])) for policy in names] for answers in SMALL.values()]
    result = stats.friedmanchisquare(*zip(*means))
    pairs = []
    for a, b in itertools.combinations(range(len(names)), 2):
        pairs.append({"a": names[a], "b": names[b]} | signed_rank([row[a] for row in means], [row[b] for row in means]))
    for pair, corrected in zip(pairs, holm([pair["p"] for pair in pairs])):
        pair["p_holm"] = corrected
    return {
        "answers": SMALL,
        "policies": [
            {"policy": policy} | summary([value for answers in SMALL.values() for value in answers[policy]])
            for policy in names
        ],
        "friedman": {
            "chi_square": float(result.statistic),
            "p_chi_square": float(result.pvalue),
            "p_permutation": friedman_exact(means),
            "kendalls_w": float(result.statistic) / (len(means) * (len(names) - 1)),
        },
        "pairs": pairs,
        "agreement": intraclass([answers[policy] for answers in SMALL.values() for policy in names]),
    }


def noise(rows, columns, seed, step=None):
    source = random.Random(seed)
    value = (lambda: round(source.gauss(0, 1), 4)) if step is None else (lambda: float(source.randint(1, step)))
    return [[value() for _ in range(columns)] for _ in range(rows)]


# Shrout & Fleiss 1979, table 2: six subjects, four judges.
SHROUT_FLEISS = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
example = intraclass(SHROUT_FLEISS)
assert (round(example["icc"], 2), round(example["low"], 3), round(example["high"], 3)) == (0.29, 0.019, 0.761)

vectors = {
    "friedman": [
        friedman("three alike", [[1.0, 2.0, 3.0]] * 3),
        friedman("no ties", noise(6, 3, 1)),
        friedman("four treatments", noise(4, 4, 2)),
        friedman("ties", noise(6, 3, 3, 3)),
        friedman("many ties", noise(5, 4, 4, 2)),
        friedman("large", noise(40, 6, 5), exact=False),
        friedman("seven treatments", noise(10, 7, 6, 5), exact=False),
    ],
    "trend": [
        trend("no ties", noise(6, 3, 11), "exact"),
        trend("six positions", noise(8, 6, 12), "exact"),
        trend("rising", [[1.0, 2.0, 3.0, 4.0]] * 5, "exact"),
        trend("ties", noise(4, 4, 13, 3), "counted"),
        trend("ten positions", noise(30, 10, 14), "asymptotic"),
    ],
    "agreement": [
        agreement("Shrout and Fleiss 1979", SHROUT_FLEISS),
        agreement("two repeats", [[a, a + b] for a, b in noise(12, 2, 21)]),
        agreement("none", noise(9, 2, 22)),
        agreement("three repeats of five points", noise(10, 3, 23, 5)),
    ],
    "summary": [
        {"values": values} | summary(values)
        for values in ([4.0], [1.0, 2.0], [3.0, 1.0, 2.5, 9.0, -4.0], noise(1, 20, 31)[0])
    ],
    "small": small(),
    "studies": [
        simulate("no effect", dict.fromkeys(POLICIES, 0), 11, 42),
        simulate("large effect", dict(zip(POLICIES, [0, 0, 2.5])), 11, 43),
    ],
}
(HERE / "analysis.json").write_text(json.dumps(vectors, indent=1) + "\n")
