"""Averages weights of a policy: `python3 tools/average_weights.py --out FILE FILE=SHARE...`.

Each weight of the new file is the sum of that weight in the others, times their shares, which add up to 1. Weights that
were trained further on something new keep more of what they did before when some of the old ones are averaged in, and
lose little of the new (Wortsman et al., Robust fine-tuning of zero-shot models, CVPR 2022). All files are safetensors
of one network, in float32. Needs numpy.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Weights = dict[str, NDArray[np.float32]]


def read(file: Path) -> Weights:
    """Return the tensors of a file. Its first 8 bytes say how long the JSON is that says where each of them lies."""
    try:
        content = file.read_bytes()
        begin = 8 + int.from_bytes(content[:8], "little")
        entries = json.loads(content[8:begin])
        entries.pop("__metadata__", None)
        if any(entry["dtype"] != "F32" for entry in entries.values()):
            raise SystemExit(f"cannot average {file}: not all of its weights are float32")
        return {name: tensor(content[begin:], **entry) for name, entry in entries.items()}
    except OSError as error:
        raise SystemExit(f"cannot read {file}: {error.strerror}") from error
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise SystemExit(f"cannot read {file}: it is not a file of weights (safetensors)") from error


def tensor(data: bytes, dtype: str, shape: list[int], data_offsets: list[int]) -> NDArray[np.float32]:
    """Return one tensor."""
    first, last = data_offsets
    return np.frombuffer(data[first:last], dtype="<f4").reshape(shape)


def average(files: list[tuple[Path, float]]) -> Weights:
    """Return the sum of the files' weights, each times its share."""
    total: Weights = {}
    for file, share in files:
        weights = read(file)
        shapes = {name: weight.shape for name, weight in weights.items()}
        if total and shapes != {name: weight.shape for name, weight in total.items()}:
            raise SystemExit(f"{file} holds the weights of another network than {files[0][0]}")
        total = {name: total.get(name, np.float32(0)) + np.float32(share) * weights[name] for name in weights}
    return total


def write(file: Path, weights: Weights, made: str) -> None:
    """Write weights, with a note of how they were made."""
    entries: dict[str, object] = {"__metadata__": {"made": made}}
    data = b""
    for name, weight in weights.items():
        raw = weight.astype("<f4").tobytes()
        entries[name] = {
            "dtype": "F32",
            "shape": weight.shape,
            "data_offsets": [len(data), len(data) + len(raw)],
        }
        data += raw
    head = json.dumps(entries).encode()
    head += b" " * (-len(head) % 8)
    # Weights that are there stay until the new ones are whole.
    unfinished = file.with_name(f".{file.name}.partial")
    try:
        unfinished.write_bytes(len(head).to_bytes(8, "little") + head + data)
        unfinished.replace(file)
    except OSError as error:
        with contextlib.suppress(OSError):
            unfinished.unlink()
        raise SystemExit(f"cannot write {file}: {error.strerror}") from error


def share_of(argument: str) -> tuple[Path, float]:
    """Read FILE=SHARE."""
    file, _, share = argument.rpartition("=")
    try:
        return Path(file), float(share)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"'{argument}' is not FILE=SHARE") from error


def main() -> None:
    """Average what the command line names."""
    parser = argparse.ArgumentParser(description="Averages weights of a policy.")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--made", default="", help="a note of how they were made, for the new file")
    parser.add_argument("files", type=share_of, nargs="+", metavar="FILE=SHARE")
    arguments = parser.parse_args()

    total = sum(share for _, share in arguments.files)
    if not math.isclose(total, 1, abs_tol=1e-6):
        raise SystemExit(f"the shares add up to {total:g}, not to 1")
    write(arguments.out, average(arguments.files), arguments.made)


if __name__ == "__main__":
    main()
