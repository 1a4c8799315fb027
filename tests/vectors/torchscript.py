"""Makes TorchScript policies that misbehave: run `python3 tests/vectors/torchscript.py`. It needs no PyTorch.

A TorchScript file is a zip archive of code, in a part of Python, and of a pickle with the module's attributes. Here both are
written by hand, in the manner of what PyTorch 2.11 writes for `steepest-frame.pt` (see `pytorch.py`).
"""

import pathlib
import zipfile

HERE = pathlib.Path(__file__).parent

# Returns no numbers once a patch is not flat.
FLAT_ONLY = """class FlatOnly(Module):
  __parameters__ = []
  __buffers__ = []
  training : bool
  def forward(self: __torch__.FlatOnly,
    patches: Tensor,
    focal_powers: Tensor) -> Tensor:
    gain = torch.sqrt(torch.sub(torch.mean(patches), torch.max(patches)))
    _0 = [torch.neg(gain), torch.zeros_like(gain), gain]
    return torch.stack(_0)
"""

# Goes up at the first frame that it ever sees and down from then on; in training it stays where it is.
FIRST_FRAME = """class FirstFrame(Module):
  __parameters__ = []
  __buffers__ = []
  training : bool
  seen : int
  def forward(self: __torch__.FirstFrame,
    patches: Tensor,
    focal_powers: Tensor) -> Tensor:
    seen = self.seen
    self.seen = torch.add(seen, 1)
    zero = torch.mul(torch.mean(patches), 0.)
    one = torch.add(zero, 1.)
    training = self.training
    if training:
      _0 = [zero, one, zero]
      values = torch.stack(_0)
    elif torch.eq(seen, 0):
      _1 = [zero, zero, one]
      values = torch.stack(_1)
    else:
      _2 = [one, zero, zero]
      values = torch.stack(_2)
    return values
"""


def text(value):
    return b"X" + len(value).to_bytes(4, "little") + value.encode()


def save(file, name, code, attributes):
    """`attributes` are pickled opcodes by name."""
    fields = b"".join(text(key) + value for key, value in attributes.items())
    data = b"\x80\x02c__torch__\n" + name.encode() + b"\n)\x81}(" + fields + b"ub."
    with zipfile.ZipFile(HERE / f"{file}.pt", "w", zipfile.ZIP_STORED) as archive:
        for path, content in [
            ("data.pkl", data),
            ("code/__torch__.py", code),
            ("constants.pkl", b"\x80\x02)."),
            ("version", "3\n"),
            ("byteorder", "little"),
        ]:
            archive.writestr(zipfile.ZipInfo(f"{file}/{path}"), content)


TRUE, ZERO = b"\x88", b"K\x00"
save("flat-only", "FlatOnly", FLAT_ONLY, {"training": TRUE})
save("first-frame", "FirstFrame", FIRST_FRAME, {"training": TRUE, "seen": ZERO})
