"""Makes the vector that the chain's bytes are tested against: run `python3 tests/vectors/chain.py`.

`chain.sql` fills an empty database with a record or two of every kind, and with the rows of the chain that
docs/evidence.md describes for them. Nothing here but Python's own library computes the hashes. Salts and times are
made up. The last row's number and hash are printed, and stand in the file's first line.
"""

import hashlib
import json
import pathlib

HERE = pathlib.Path(__file__).parent

SESSION = "0b9d8f2a-5c1e-4a6f-9d3b-1f2e3d4c5b6a"
OTHER = "9e8d7c6b-5a49-4838-8271-60594a3b2c1d"
SEGMENTS = ["11111111-1111-4111-8111-111111111111", "22222222-2222-4222-8222-222222222222"]
DEVICE = "33333333-3333-4333-8333-333333333333"
KEYS = [f"{number:08d}-0000-4000-8000-{number:012d}" for number in range(1, 6)]


def sha256(*fields):
    """The hash of a list of texts, each as a netstring."""
    digest = hashlib.sha256()
    for field in fields:
        field = field.encode()
        digest.update(b"%d:%s," % (len(field), field))
    return digest.hexdigest()


def wall(second):
    return f"2026-03-02T08:00:{second:02d}.5Z"


def salt(name):
    return hashlib.sha256(name.encode()).hexdigest()[:32]


def literal(value):
    """`value` as SQL."""
    if value is None:
        return "NULL"
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    return str(value)


class Real:
    """A number with a fraction, as SQL and as the CSV files have it."""

    def __init__(self, sql, text):
        self.sql, self.text = sql, text

    def __str__(self):
        return self.sql


def text(value):
    """`value` as the CSV files have it. Booleans are given as Python's own."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Real):
        return value.text
    return str(value)


lines = []
places = {}
head = (0, "0" * 64)


def insert(table, **columns):
    values = ", ".join(literal(int(value) if isinstance(value, bool) else value) for value in columns.values())
    lines.append(f"INSERT INTO {table} ({', '.join(columns)}) VALUES ({values});")


def chain(kind, key, session, content_of, sealed_fields=(), erased=False):
    """Appends the chain's row. `content_of` are the parts between kind and sealed hash."""
    global head
    number = head[0] + 1
    sealed_salt = salt(f"sealed {number}")
    sealed = sha256("parfocal-sealed-1", sealed_salt, *sealed_fields) if sealed_fields else ""
    content = sha256("parfocal-record-1", kind, *content_of, sealed)
    place = None
    if session is not None:
        place = places[session] = places.get(session, 0) + 1
    fields = [salt(f"entry {number}"), wall(number), kind, key, session or "", text(place), "false", sealed, content]
    hashed = sha256("parfocal-chain-1", str(number), head[1], sha256("parfocal-entry-1", *fields))
    insert(
        "chain",
        number=number,
        wall=wall(number),
        kind=kind,
        key=key,
        session=session,
        place=place,
        salt=fields[0],
        sealed=sealed,
        content=content,
        previous=head[1],
        hash=hashed,
    )
    if sealed_fields and not erased:
        insert("chain_salts", number=number, salt=sealed_salt)
    head = (number, hashed)


def record(kind, key, session, open_columns, sealed_columns=None, erased=False):
    """Chains a record of these columns. Of an erased one, `sealed_columns` are what they were."""
    parts = [part for name, value in open_columns.items() for part in (name, text(value))]
    chain(kind, key, session, parts, [text(value) for value in (sealed_columns or {}).values()], erased)


def kept(table, kind, key, session, open_columns, sealed_columns=None):
    """Inserts a record whose columns are hashed as they are kept, and chains it."""
    insert(table, **open_columns, **(sealed_columns or {}))
    record(kind, key, session, open_columns, sealed_columns)


# Two starts of the server: one with everything, one with as little as possible.
for run, blur, seed, weights in [
    (1, Real("12.5", "12.5"), 7, '{"cnn-learned":"' + "ab" * 32 + '"}'),
    (2, None, None, "{}"),
]:
    columns = dict(
        run=run,
        wall=wall(run),
        monotonic_ns=run * 1000,
        version="0.1.0",
        camera="phantom, “dark”",
        lens="simulated",
        calibration="none",
        blur=blur,
    )
    kept("runs", "run", str(run), None, columns, dict(weights=weights, seed=seed))

for code in ["S-01", "S-02"]:
    kept("participants", "participant", code, None, dict(code=code, wall=wall(3)))

for session, participant, practice, segments in [(SESSION, "S-01", False, SEGMENTS), (OTHER, "S-02", True, [])]:
    columns = dict(
        session=session,
        participant=participant,
        protocol="pair",
        protocol_sha256="cd" * 32,
        practice=practice,
        algorithm="shuffled-1",
        commitment="ef" * 32,
        wall=wall(5),
        run=1,
        monotonic_ns=5_000_000_000,
    )
    insert("sessions", **columns, protocol_toml="name = 'pair'", seed="00" * 32, set_index=0)
    for setting, segment in enumerate(segments, 1):
        policy = ["cnn-learned", "hill-climb"][setting - 1]
        insert("segments", number=setting, segment=segment, session=session, setting=setting, policy=policy)
    record("session", session, session, columns | dict(segments=",".join(segments)))

# A personal account, what happened to it, and under which account the session was made.
insert(
    "accounts",
    account="km",
    display="Kim Mäkelä",
    role="lead",
    disabled=0,
    memory_kib=64,
    passes=1,
    salt="",
    hash="",
)
for number, run, monotonic, done_by, detail in [(1, None, None, None, "lead"), (2, 1, 6_000, "km", None)]:
    columns = dict(
        number=number,
        run=run,
        wall=wall(6),
        monotonic_ns=monotonic,
        account="km",
        kind="made" if run is None else "signed-in",
        done_by=done_by,
        detail=detail,
    )
    kept("account_events", "account-event", str(number), None, columns)
columns = dict(number=1, kind="session", record=SESSION, session=SESSION, account="km", display="Kim Mäkelä")
kept("actors", "actor", "1", SESSION, columns)

def as_json(number):
    return None if number is None else json.dumps(number).replace("1e-07", "1e-7")


# Events, whose segment, place in the setting, emergency and reason are in a JSON payload.
for number, kind, payload in [
    (1, "created", {}),
    (2, "segment-started", {"segment": SEGMENTS[0], "inspected_ms": 0}),
    (3, "paused", {"segment": SEGMENTS[0], "inspected_ms": 1500, "reason": "smoke, “much” of it"}),
    (4, "unblinded", {"emergency": True, "reason": "adverse event"}),
    (5, "unblinded", {"emergency": False, "reason": ""}),
    (6, "reason-given", {"about": 3, "reason": "the smoke"}),
    (7, "focused-by-hand", {"focal_power": 0.30000000000000004, "left_at": 1e-07}),
    (8, "tablet-away", {"hidden": True}),
    (
        9,
        "pictures-seen",
        {"segment": SEGMENTS[0], "width": 512, "height": 272, "pictures": 20, "over_ms": 1500},
    ),
    (
        10,
        "patch-placed",
        {"segment": SEGMENTS[0], "frame": 2**64 - 1, "x": 300.25, "y": 90.0, "place": [0.4425, -0.46]},
    ),
    (11, "patch-centred", {"segment": SEGMENTS[0], "frame": 12}),
    (12, "focus-held", {"segment": SEGMENTS[0]}),
    (13, "focus-released", {"segment": SEGMENTS[0]}),
]:
    columns = dict(session=SESSION, number=number, run=1, wall=wall(7), monotonic_ns=7_000 + number, role="operator")
    # As the program writes it: 1e-7, where Python writes 1e-07.
    whole = json.dumps({"kind": kind} | payload, ensure_ascii=False).replace("1e-07", "1e-7")
    insert("events", **columns, kind=kind, payload=whole)
    hashed = dict(
        session=SESSION,
        number=number,
        wall=wall(7),
        run=1,
        monotonic_ns=7_000 + number,
        role="operator",
        kind=kind,
        segment=payload.get("segment"),
        inspected_ms=payload.get("inspected_ms"),
        emergency=payload.get("emergency"),
        about=payload.get("about"),
        focal_power=as_json(payload.get("focal_power")),
        left_at=as_json(payload.get("left_at")),
        hidden=payload.get("hidden"),
        picture_width=payload.get("width"),
        picture_height=payload.get("height"),
        pictures=payload.get("pictures"),
        over_ms=payload.get("over_ms"),
        frame=payload.get("frame"),
        touched_x=as_json(payload.get("x")),
        touched_y=as_json(payload.get("y")),
        patch_across=as_json(payload.get("place", [None])[0]),
        patch_down=as_json(payload.get("place", [None])[-1]),
    )
    record("event", f"{SESSION}/{number}", SESSION, hashed, dict(reason=payload.get("reason")))

# Comments: one with everything, one with nothing, one whose words were erased, one aloud. A frame's number can be
# larger than SQLite's integers; it is kept as the negative one of the same bits.
for number, key, kind, frame, said, erased, full in [
    (1, KEYS[0], "text", 2**64 - 1, "shärp 🔬, \"good\"\nat rest", False, True),
    (2, KEYS[1], "mark", None, None, False, False),
    (3, KEYS[2], "quick", 12, "=too blurred", True, True),
    (4, KEYS[3], "voice", 2**63 - 1, None, False, True),
]:
    columns = dict(
        key=key,
        session=SESSION,
        segment=SEGMENTS[0] if full else None,
        kind=kind,
        frame=frame,
        frame_run=1 if full else None,
        picture_width=1024 if full else None,
        pictures_per_second=Real("12.5", "12.5") if full else None,
        wall=wall(8),
        run=2,
        monotonic_ns=8_000,
        client_millis=1_772_438_408_000 if full else None,
        waited_ms=80_000 if full else None,
        waited_by="page-clock" if full else None,
        device=DEVICE if full else None,
        sequence=number if full else None,
        late=not full,
    )
    as_kept = columns | dict(frame=frame - 2**64 if frame is not None and frame >= 2**63 else frame)
    insert("comments", number=number, **as_kept, text="" if erased else said)
    record("comment", key, SESSION, columns, dict(text=said), erased)

for number, key, segment, value, waited in [
    (1, KEYS[0], SEGMENTS[1], "7", (0, "wall-clock")),
    (2, KEYS[4], None, '{"items":[1,null,"é"]}', (None, None)),
]:
    columns = dict(
        key=key,
        session=SESSION,
        segment=segment,
        question="sharpness",
        wall=wall(9),
        run=1,
        monotonic_ns=9_000,
        client_millis=1_772_438_409_000,
        waited_ms=waited[0],
        waited_by=waited[1],
        device=DEVICE,
        sequence=10 + number,
        late=waited[0] is None,
    )
    insert("answers", number=number, **columns, value=value)
    record("answer", key, SESSION, columns, dict(given_value=value))

for piece, ended, through in [(1, None, 1024), (2, "released", 1500)]:
    columns = dict(
        number=piece,
        session=SESSION,
        comment=KEYS[3],
        piece=piece,
        media_type="audio/webm;codecs=opus",
        through_ms=through,
        ended=ended,
        bytes=3 if ended is None else 0,
        sha256=hashlib.sha256(b"abc" if ended is None else b"").hexdigest(),
        wall=wall(10),
        run=1,
        monotonic_ns=10_000 + piece,
    )
    names, values = ", ".join(columns), ", ".join(literal(value) for value in columns.values())
    audio = "x'616263'" if ended is None else "x''"
    lines.append(f"INSERT INTO voice_pieces ({names}, audio) VALUES ({values}, {audio});")
    record("voice-piece", str(piece), SESSION, columns)

for number, working in [(1, False), (2, True)]:
    columns = dict(
        number=number, wall=wall(11), run=1, monotonic_ns=11_000, device="camera", working=working, message="unplugged"
    )
    insert("device_events", **columns)
    record("device", str(number), None, columns)

for number, run, monotonic, session, detail in [(1, 1, 12_000, None, None), (2, None, None, SESSION, "blinded")]:
    columns = dict(
        number=number,
        wall=wall(12),
        run=run,
        monotonic_ns=monotonic,
        role="researcher" if run else "command-line",
        kind="entered" if run else "exported",
        session=session,
        detail=detail,
    )
    kept("accesses", "access", str(number), session, columns)

columns = dict(
    number=1,
    session=SESSION,
    subject="answer",
    record=KEYS[0],
    field="value",
    role="researcher",
    wall=wall(13),
    run=1,
    monotonic_ns=13_000,
)
changed = dict(old_value="7", new_value="6", reason="pressed beside it")
kept("corrections", "correction", "1", SESSION, columns, changed)

columns = dict(
    number=1,
    session=SESSION,
    text_version="2.1",
    given_on="2026-03-01",
    medium="paper",
    role="operator",
    wall=wall(14),
    run=1,
    monotonic_ns=14_000,
)
kept("consents", "consent", "1", SESSION, columns, dict(obtained_by="KM"))

columns = dict(
    number=1,
    session=SESSION,
    subject="comment",
    record=KEYS[2],
    role="researcher",
    wall=wall(15),
    run=1,
    monotonic_ns=15_000,
)
kept("erasures", "erasure", "1", SESSION, columns, dict(reason="names a patient"))

columns = dict(study="scope-2026", definition_sha256="12" * 32, sites='["leeds"]', wall=wall(16))
insert("studies", **columns, definition="name = 'scope-2026'")
record("study", "scope-2026", None, columns)

for number, run, monotonic, about, commitment, reason in [
    (1, None, None, None, None, "a pilot"),
    (2, 1, 17_000, None, "34" * 32, "ready"),
    (3, 1, 17_001, SESSION, None, "withdrew, by telephone"),
]:
    columns = dict(
        study="scope-2026",
        number=number,
        wall=wall(17),
        run=run,
        monotonic_ns=monotonic,
        role="researcher" if run else "command-line",
        person="Kim Mäkelä",
        kind=["planned", "opened", "session-withdrawn"][number - 1],
    )
    insert("study_events", **columns, session=about, commitment=commitment, reason=reason)
    hashed = columns | dict(about_session=about, commitment=commitment)
    record("study-event", f"scope-2026/{number}", None, hashed, dict(reason=reason))

columns = dict(session=SESSION, study="scope-2026", site="leeds", protocol="pair", place=3)
kept("study_sessions", "study-session", SESSION, SESSION, columns)

# Telemetry: the steps of a setting are chained in blocks. Holds for the policy's sake do not show in the open columns.
insert("policies", number=1, name="cnn-learned")
steps = [
    (100, "1", Real("0.35", "0.35"), None, Real("12.5", "12.5"), None, Real("0.4", "0.4")),
    (101, "1", Real("1.0", "1.0"), Real("0.3333333333333333", "0.3333333333333333"), None, "policy-slow", None),
    (103, None, Real("0.0", "0.0"), Real("1e-07", "1e-7"), Real("1e+300", "1e+300"), "paused", None),
]
open_fields, sealed_fields = [], []
for frame, policy, asked, measured, metric, held, optimal in steps:
    insert(
        "telemetry",
        run=1,
        frame=frame,
        exposed_ns=frame * 20_000_000,
        segment=1,
        policy=int(policy) if policy else None,
        asked=asked,
        measured=measured,
        metric=metric,
        policy_micros=17,
        latency_micros=640,
        held=held,
        optimal=optimal,
        picture_width=512 if policy else None,
        patch_x=240,
        patch_y=120 + frame,
    )
    is_held = held in ("paused", "focus-held", "lens-failed", "camera-failed")
    open_fields += [1, frame, frame * 20_000_000, asked, measured, is_held, optimal, 512 if policy else None]
    open_fields += [240, 120 + frame]
    sealed_fields += ["cnn-learned" if policy else None, metric, 17, 640, held]
steps_sha256 = sha256("parfocal-steps-1", *(text(value) for value in open_fields))
parts = ["segment", SEGMENTS[0], "first", "1", "last", "3", "steps_sha256", steps_sha256]
chain("telemetry", f"{SEGMENTS[0]}/1/3", SESSION, parts, [text(value) for value in sealed_fields])

told = f"{head[0]}:{head[1]}"
(HERE / "chain.sql").write_text(f"-- Made by chain.py. Head: {told}\n" + "\n".join(lines) + "\n")
print(told)
