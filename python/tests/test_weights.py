"""The average of weights, as the shipped ones were made."""

from __future__ import annotations

import json
import resource
import struct
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[1] / "tools/average_weights.py"


def write(file: Path, kind: str = "F32", **tensors: list[float]) -> str:
    """Write flat tensors as safetensors."""
    entries, data = {}, b""
    for name, values in tensors.items():
        raw = struct.pack(f"<{len(values)}f", *values)
        entries[name] = {
            "dtype": kind,
            "shape": [len(values)],
            "data_offsets": [len(data), len(data) + len(raw)],
        }
        data += raw
    head = json.dumps(entries).encode()
    file.write_bytes(struct.pack("<Q", len(head)) + head + data)
    return str(file)


def run(out: Path, *files: str) -> subprocess.CompletedProcess[str]:
    """Run the tool."""
    command = [sys.executable, "-s", str(TOOL), "--out", str(out), "--made", "by hand", *files]
    return subprocess.run(command, capture_output=True, text=True)


def test_each_weight_is_the_sum_of_its_shares(tmp_path: Path) -> None:
    """Tensors may stand in another order; shares are by file."""
    one = write(tmp_path / "one.safetensors", bias=[1.0, 2.0], weight=[10.0])
    two = write(tmp_path / "two.safetensors", weight=[20.0], bias=[3.0, -2.0])
    out = tmp_path / "out.safetensors"
    assert run(out, f"{one}=0.75", f"{two}=0.25").returncode == 0

    content = out.read_bytes()
    begin = 8 + struct.unpack("<Q", content[:8])[0]
    head = json.loads(content[8:begin])
    assert head.pop("__metadata__") == {"made": "by hand"}
    read = {}
    for name, entry in head.items():
        first, last = entry["data_offsets"]
        assert entry["dtype"] == "F32"
        read[name] = struct.unpack(f"<{entry['shape'][0]}f", content[begin + first : begin + last])
    assert read == {"bias": (1.5, 1.0), "weight": (12.5,)}


@pytest.mark.parametrize(
    ("files", "complaint"),
    [
        (["one=0.5", "one=0.4"], "the shares add up to 0.9, not to 1"),
        (["one=0.5", "other=0.5"], "other holds the weights of another network than "),
        (["one=0.5", "whole=0.5"], "whole: not all of its weights are float32"),
        (["one=0.5", "torn=0.5"], "torn: it is not a file of weights (safetensors)"),
        (["one=0.5", "missing=0.5"], "missing: No such file or directory"),
        (["one=half"], "one=half' is not FILE=SHARE"),
    ],
)
def test_what_cannot_be_averaged_is_named(tmp_path: Path, files: list[str], complaint: str) -> None:
    """Nothing is written then."""
    write(tmp_path / "one", bias=[1.0])
    write(tmp_path / "other", bias=[1.0, 2.0])
    write(tmp_path / "whole", kind="I32", bias=[1.0])
    (tmp_path / "torn").write_bytes(b"\x10\0\0\0\0\0\0\0{")
    done = run(tmp_path / "out", *(str(tmp_path / file) for file in files))
    assert done.returncode != 0
    assert complaint in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    """The folder is missing."""
    one = write(tmp_path / "one", bias=[1.0])
    done = run(tmp_path / "missing/out", f"{one}=1")
    assert done.returncode == 1
    assert done.stderr == f"cannot write {tmp_path / 'missing/out'}: No such file or directory\n"


def test_weights_that_are_there_stay_if_the_new_ones_do_not_fit_onto_the_disk(tmp_path: Path) -> None:
    """They may be those that are averaged."""
    one = write(tmp_path / "one", bias=[1.0] * 4096)
    before = Path(one).read_bytes()
    done = subprocess.run(
        [sys.executable, "-s", str(TOOL), "--out", one, f"{one}=1"],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)),
    )
    assert done.returncode == 1
    assert done.stderr == f"cannot write {one}: File too large\n"
    assert Path(one).read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["one"]
