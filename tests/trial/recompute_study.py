"""Draws the orders of a study again, from docs/study.md and docs/trial.md alone, with Python's own library."""

import hashlib
import itertools
import json
import pathlib
import struct
import sys
import tomllib


def sha256(text):
    return hashlib.sha256(text.encode()).hexdigest()


def chacha20_words(key):
    """The key stream of RFC 8439 with counter and nonce zero, as 32-bit words."""

    def turn(state, a, b, c, d):
        for x, y, z, bits in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
            state[x] = (state[x] + state[y]) & 0xFFFFFFFF
            mixed = state[z] ^ state[x]
            state[z] = ((mixed << bits) | (mixed >> (32 - bits))) & 0xFFFFFFFF

    for counter in itertools.count():
        start = [0x61707865, 0x3320646E, 0x79622D32, 0x6B206574, *struct.unpack("<8I", key), counter, 0, 0, 0]
        state = start[:]
        for _ in range(10):
            for a, b, c, d in ((0, 4, 8, 12), (1, 5, 9, 13), (2, 6, 10, 14), (3, 7, 11, 15)):
                turn(state, a, b, c, d)
            for a, b, c, d in ((0, 5, 10, 15), (1, 6, 11, 12), (2, 7, 8, 13), (3, 4, 9, 14)):
                turn(state, a, b, c, d)
        yield from ((x + y) & 0xFFFFFFFF for x, y in zip(state, start))


def shuffle(words, items):
    for i in range(len(items) - 1, 0, -1):
        limit = 2**32 - 2**32 % (i + 1)
        word = next(word for word in words if word < limit)
        j = word % (i + 1)
        items[i], items[j] = items[j], items[i]


def balanced(seed, policies, repeats, index):
    words = chacha20_words(bytes.fromhex(seed))
    order = [policy for policy in range(policies) for _ in range(repeats)]
    shuffle(words, order)
    while any(a == b for a, b in zip(order, order[1:])):
        shuffle(words, order)
    relabellings = list(itertools.permutations(range(policies)))
    shuffle(words, relabellings)
    return [relabellings[index][policy] for policy in order]


def main(folder):
    definition = (folder / "study.toml").read_bytes()
    study = tomllib.loads(definition.decode())
    protocol = tomllib.loads((folder / "protocol.toml").read_text())
    allocation = json.loads((folder / "allocation.json").read_text())
    seed = next(line[5:] for line in allocation["study_statement"].splitlines() if line.startswith("seed "))
    names, repeats = protocol["policies"], protocol["repeats"]
    size = len(list(itertools.permutations(names)))

    lines = ["parfocal-study-commitment-1", f"study {study['name']}"]
    lines += [f"definition {hashlib.sha256(definition).hexdigest()}", f"seed {seed}"]
    schedules = {}
    for site in study["sites"]:
        name = f"{site['name']} {protocol['name']}"
        lines.append(f"list {name} parfocal-balanced-1")
        for place in range(site["surgeons"] + site["spares"]):
            which = f"parfocal-study-set-1\nseed {seed}\nlist {name}\nset {place // size + 1}\n"
            order = balanced(sha256(which), len(names), repeats, place % size)
            schedule = ",".join(names[policy] for policy in order)
            schedules[site["name"], place + 1] = schedule
            lines.append(f"place {place + 1} {schedule}")
    statement = "".join(line + "\n" for line in lines)

    header, row = (line.split(",") for line in (folder / "study_sessions.csv").read_text().splitlines())
    session = dict(zip(header, row))
    told = {
        "statement": statement,
        "commitment": sha256(statement),
        "definition": hashlib.sha256(definition).hexdigest(),
        "schedule": schedules[session["site"], int(session["place"])],
    }
    print(json.dumps(told))


main(pathlib.Path(sys.argv[1]))
