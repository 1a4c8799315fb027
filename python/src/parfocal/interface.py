"""The HTTP interface: its types, and a method for each of its requests.

Written by ``tools/generate_interface.py``. Do not edit.
"""

from __future__ import annotations

import builtins
import sys
from collections.abc import Awaitable, Callable
from typing import Any, Literal, TypedDict

if sys.version_info >= (3, 11):
    from typing import NotRequired
else:
    from typing_extensions import NotRequired

VERSION = "0.1.0"
"""The version of the server whose interface this is."""


class Account(TypedDict):
    """An account."""

    account: AccountName
    """The name that the person signs in with."""

    disabled: bool
    """Whether the account is disabled: nobody can sign in to it."""

    display: str
    """The person's name, as signatures show it."""

    role: AccountRole
    """The role, which decides what the person may do."""

AccountAction = dict[str, Any]
"""A change to make to an account."""

class AccountLine(TypedDict):
    """An account as a lead sees it."""

    account: AccountName
    """The name that the person signs in with."""

    disabled: bool
    """Whether the account is disabled: nobody can sign in to it."""

    display: str
    """The person's name, as signatures show it."""

    role: AccountRole
    """The role, which decides what the person may do."""

    last_signed_in: NotRequired[str | None]
    """When the person last signed in."""

    set_by_another: bool
    """Whether a lead set its passphrase: the person then has to choose another to sign in."""

AccountName = str
"""The name that a person signs in with: 1 to 40 lower-case letters, digits, dots and dashes."""

AccountRole = Literal["lead", "operator", "researcher", "monitor"]
"""The role of a personal account in studies."""

Act = dict[str, Any]
"""An action on a session."""

Action = dict[str, Any]
"""An action that advances a session. `segment` is the segment that the page was showing, so that a
stale tab or a double click does not advance the session twice."""

class Adjustable(TypedDict):
    """A setting's value and the bounds that the camera gives for it."""

    max: float
    """Greatest value."""

    min: float
    """Least value."""

    setting: Setting
    """The setting."""

    value: float
    """Its present value."""

class Agreement(TypedDict):
    """Agreement of repeats."""

    high: NotRequired[float | None]
    """Upper end of its 95 % interval; none if it cannot be computed."""

    icc: float
    """ICC(A,1), at most 1; negative if repeats differ more than subjects."""

    low: NotRequired[float | None]
    """Lower end of its 95 % interval; none if it cannot be computed."""

class AnalysedSession(TypedDict):
    """A session of the study, and whether it counts."""

    counts: bool
    """Whether it counts."""

    remark: NotRequired[str | None]
    """Why it does not count, or a remark on a session that counts."""

    session: SessionId
    """The session."""

    site: str
    """Name of the site."""

    surgeon: NotRequired[str | None]
    """The surgeon's code, corrected if it was; none for a withdrawn session."""

class Analysis(TypedDict):
    """The analysis of an unblinded study."""

    definition_sha256: str
    """SHA-256 of the study's definition."""

    missing_sites: builtins.list[str]
    """Names of the definition's sites that have no session in this analysis."""

    notes: builtins.list[str]
    """Notes that apply to all figures."""

    planned: str
    """The planned analysis, as in the definition."""

    protocols: builtins.list[ProtocolAnalysis]
    """One analysis per protocol."""

    seed: str
    """Seed of resamples and permutations: the first 16 hexadecimal digits of `definition_sha256`."""

    sites: builtins.list[str]
    """Names of the study's sites that this database, or the databases of this package, run."""

    study: str
    """Name of the study."""

    title: str
    """Title of the study."""

    unblinded: str
    """When the study was unblinded, by the server's wall clock."""

class AnswerLine(TypedDict):
    """An answer, as it is shown."""

    at: str
    """When it was recorded, by the server's wall clock."""

    changed: bool
    """Whether it replaced an earlier answer."""

    corrected: NotRequired[AnswerValue | None]

    corrected_words: NotRequired[str | None]
    """The corrected answer in words."""

    devices_disagree: bool
    """Whether another of the surgeon's devices gave a different answer; the timeline shows it."""

    erased: NotRequired[str | None]
    """When its words were erased, by the server's wall clock; none if they were not."""

    key: IdempotencyKey
    """The answer's key."""

    kind: NotRequired[str | None]
    """The question's kind; none if it is not known."""

    note: NotRequired[str | None]
    """A researcher's note on the answer."""

    question: str
    """The question's identifier."""

    scores: builtins.list[Measure]
    """Its scores, from the corrected answer if there is one; none if it has no score or an item is
    missing."""

    setting: NotRequired[int | None]
    """Setting, from 1; none for a closing question."""

    sus_score: NotRequired[float | None]
    """The score of the System Usability Scale, 0 to 100, for its ten items."""

    text: str
    """The question's text."""

    value: AnswerValue
    """The answer as it was given."""

    words: str
    """The answer in words."""

AnswerValue = int | builtins.list[int] | str
"""The value of an answer."""

BackupState = dict[str, Any]
"""The state of the latest backup."""

class BandLevel(TypedDict):
    """What a band shows at a place."""

    counts: float
    """Mean of the raw counts."""

    counts_spread: float
    """Standard deviation of the raw counts."""

    fwhm_nm: float
    """Full width of the band at half of its maximum, nm."""

    reflectance: NotRequired[float | None]
    """Mean reflectance: 0 as dark as the dark reference, 1 as bright as the white one. Null without a
    white reference."""

    reflectance_spread: NotRequired[float | None]
    """Standard deviation of the reflectance. Null without a white reference."""

    wavelength_nm: float
    """Wavelength at which the band is most sensitive, nm."""

class CameraOffer(TypedDict):
    """What can be changed, and whether the last change failed."""

    settings: builtins.list[Adjustable]
    """Every setting that the camera offers now."""

    trouble: NotRequired[str | None]
    """Why the camera did not make the last change, if it did not."""

class ChainHead(TypedDict):
    """The latest row of the chain of records."""

    hash: str
    """Its hash: SHA-256, hexadecimal."""

    head: str
    """Number and hash as the pages show them, for `parfocal verify --head`."""

    number: int
    """Its number, from 1."""

class Change(TypedDict):
    """A setting to change."""

    setting: Setting
    """The setting."""

    value: float
    """The new value: microseconds, the camera's unit of gain, or frames a second."""

ChangeAccount = dict[str, Any]
"""A change of an account, confirmed by a lead."""

ChangeStudy = dict[str, Any]
"""A signed change of a study."""

class Checks(TypedDict):
    """Results of all checks."""

    at: str
    """When the checks were made, by the server's wall clock."""

    findings: builtins.list[Finding]
    """One result for each thing that was checked."""

class Choices(TypedDict):
    """What the operator can choose from."""

    participants: builtins.list[str]
    """Codes of the participants."""

    policies: builtins.list[dict[str, Any]]
    """The policies."""

    protocols: builtins.list[ProtocolSummary]
    """The protocols."""

    studies: builtins.list[OpenStudy]
    """Studies in which sessions can be made now."""

Code = Literal["camera-silent", "lens-gone", "lens-warns", "disk-nearly-full", "disk-silent", "database-troubled", "database-unwritable", "events-unrecorded", "telemetry-lost", "loop-stalled"]
"""What can be wrong. Programs may rely on these names."""

CommentContent = dict[str, Any]
"""The content of a comment."""

CommentLine = dict[str, Any]
"""A comment, as it is shown."""

class Comparison(TypedDict):
    """An outcome compared between policies."""

    better: NotRequired[str | None]
    """Which end is better, if known: `higher` or `lower`."""

    highest: NotRequired[float | None]
    """Highest possible value; none if there is no limit."""

    label: str
    """Label for people."""

    lowest: NotRequired[float | None]
    """Lowest possible value; none if there is no limit."""

    outcome: str
    """Name: question and measure, or a quantity of the focal power."""

    unit: str
    """Unit or scale."""

    complete: int
    """Number of surgeons without a missing value; the tests use these."""

    difference: Difference
    """Whether the policies differ."""

    left_out: int
    """Number of surgeons left out of the tests because a value is missing."""

    pairs: builtins.list[PolicyPair]
    """Every pair of policies."""

    policies: builtins.list[PolicySummary]
    """Each policy's values over all settings."""

    position: Position
    """Whether values rise or fall with the position in the session."""

    repeats: Repeats
    """How far repeats of a policy agree."""

    surgeons: builtins.list[SurgeonMeans]
    """Each surgeon's mean of each policy."""

Condition = Literal["ok", "degraded", "failing"]
"""The server's condition."""

class Consent(TypedDict):
    """A recorded consent of a participant."""

    given_on: str
    """Day on which the consent was given."""

    medium: Medium
    """Whether the consent was given on paper or on a screen."""

    obtained_by: str
    """Person who obtained the consent: initials or a code."""

    text_version: str
    """Version of the consent text."""

class ConsentLine(TypedDict):
    """A consent, as it is shown."""

    given_on: str
    """Day on which the consent was given."""

    medium: Medium
    """Whether the consent was given on paper or on a screen."""

    obtained_by: str
    """Person who obtained the consent: initials or a code."""

    text_version: str
    """Version of the consent text."""

    at: str
    """When it was recorded, by the server's wall clock."""

class CorrectionLine(TypedDict):
    """A correction, as it is shown."""

    about: str
    """The corrected record, in words."""

    at: str
    """When it was recorded, by the server's wall clock."""

    by: Role
    """Role that recorded it."""

    erased: NotRequired[str | None]
    """When its words were erased, by the server's wall clock; none if they were not."""

    field: Field
    """The corrected part of the record."""

    new: str
    """The corrected value, in words."""

    number: int
    """Order of the record in the database."""

    old: str
    """The value before the correction, in words."""

    reason: str
    """Reason for the correction."""

DeviceId = str
"""A browser that surgeons use, all its tabs together. Random, made by its page and kept there."""

class Difference(TypedDict):
    """Whether the policies differ."""

    friedman: NotRequired[Friedman | None]

    said: str
    """The finding in a sentence, or why there is none."""

    w_interval: NotRequired[Interval | None]

class Dismissal(TypedDict):
    """A session to take off the screens."""

    session: SessionId
    """The session."""

Ending = Literal["released", "limit", "microphone-lost", "left"]
"""Why a recording ended."""

Erasable = Literal["answer", "comment", "correction", "event", "study-event"]
"""A record whose words can be erased."""

class EraseAll(TypedDict):
    """An erasure of all words of a session."""

    reason: str
    """Why; stored with each erasure. It must not repeat the words."""

class ErrorBody(TypedDict):
    """An error as programs get it."""

    error: str
    """What happened and what to do."""

    sign_in: NotRequired[bool]
    """Whether signing in under a personal account would help."""

class ExportStudy(TypedDict):
    """What to export."""

    unblinded: NotRequired[bool]
    """Whether to include which policy ran in which setting; only after unblinding."""

Field = Literal["participant", "value", "note"]
"""The corrected part of a record."""

FieldChange = dict[str, Any]
"""The corrected field. `old` is the value that the page showed, so that nobody overwrites another
person's correction without seeing it."""

class Finding(TypedDict):
    """One thing that was checked."""

    advice: NotRequired[str | None]
    """What to do about it; none if all is well."""

    found: str
    """What was found, in words."""

    subject: str
    """What was checked, for example `disk`."""

    verdict: Verdict
    """The result."""

Focus = dict[str, Any]
"""What focuses the lens outside sessions."""

class Friedman(TypedDict):
    """Result of Friedman's test."""

    chi_square: float
    """The statistic, corrected for ties."""

    df: int
    """Degrees of freedom: treatments minus one."""

    kendalls_w: float
    """Kendall's W, 0..=1: how far the blocks agree on an order."""

    mean_ranks: builtins.list[float]
    """The mean rank of each treatment; rank 1 is the lowest value."""

    p_chi_square: float
    """p from the chi-square distribution, a rough approximation for few blocks."""

    p_permutation: float
    """p over the permutations of each block's ranks."""

    permutation: PermutationMethod
    """How `p_permutation` was computed."""

class Health(TypedDict):
    """The server's health."""

    camera: bool
    """Whether the camera delivers frames."""

    lens: bool
    """Whether the lens takes commands."""

    problems: builtins.list[Problem]
    """Problems, the most severe first."""

    simulated: bool
    """Whether the camera or the lens is simulated."""

    status: Condition
    """The server's condition."""

    version: str
    """The program's version."""

HoldSpan = TypedDict("HoldSpan", {"from": "float", "to": "NotRequired[float | None]"})
"""When the focus was held on request."""

class Holding(TypedDict):
    """The number of comments and answers that a surgeon's device still holds."""

    device: DeviceId
    """Device that holds them."""

    holding: int
    """Number of comments and answers whose saving the device has not seen confirmed, half-written ones
    included."""

    session: SessionId
    """Session in which they were given."""

IdempotencyKey = str
"""Made by a browser for one comment or answer, which is kept once, however often it is sent."""

class Interval(TypedDict):
    """A 95 % interval."""

    high: float
    """Upper end."""

    low: float
    """Lower end."""

Language = Literal["en", "de", "fr", "es"]
"""A language that surgeons can read."""

class LivePlace(TypedDict):
    """A circle in the camera's mosaic."""

    radius: NotRequired[float]
    """All cells whose middle is this near to the centre are taken, in samples. With 0, the cell there."""

    x: float
    """Centre: samples of the mosaic from its left edge."""

    y: float
    """Centre: samples of the mosaic from its upper edge."""

class LivePlaces(TypedDict):
    """Places of the live picture."""

    places: builtins.list[LivePlace]
    """The places."""

class LiveSpectra(TypedDict):
    """The spectra of one frame."""

    frame: int
    """Number of the frame."""

    spectra: builtins.list[PlaceSpectrum]
    """The spectrum at each place, in the order in which they were asked for."""

class LogLine(TypedDict):
    """An event in words."""

    account: NotRequired[str | None]
    """Account of the person who caused the event, if signed in."""

    at: str
    """Time of the event, by the server's wall clock."""

    by: Role
    """Role that caused the event."""

    erasable_event: NotRequired[int | None]
    """Number of the session's event that this line shows, if the event has a reason that a researcher
    can erase."""

    text: str
    """Description of the event."""

class MakeBackup(TypedDict):
    """A request for a backup."""

    passphrase: str
    """The lead's own passphrase, entered again."""

class Measure(TypedDict):
    """An item or a score of an answer as a number."""

    label: str
    """Name of the measure for people."""

    name: str
    """Name of the measure: lower-case letters, digits and dashes."""

    score: bool
    """Whether the number is computed from other items."""

    value: NotRequired[float | None]
    """The number; none if it is missing."""

Medium = Literal["paper", "screen"]
"""Where a consent was given."""

Method = Literal["exact", "normal-approximation"]
"""How a [`SignedRank`]'s p was computed."""

class NewAccount(TypedDict):
    """An account to be made."""

    account: str
    """The name that the person will sign in with: lower-case letters, digits, dots and dashes."""

    display: str
    """The person's name, as it will appear in signatures."""

    first_passphrase: str
    """The passphrase for the person's first sign-in, where the person then chooses another."""

    passphrase: str
    """The lead's own passphrase, entered again."""

    role: AccountRole
    """What the person may do."""

class NewAnswer(TypedDict):
    """An answer as a surgeon's browser sends it. If there are several answers to a question, the one given
    last counts, in whatever order they arrive. Items that it leaves open keep their earlier values. The
    other answers stay in the log."""

    client_millis: NotRequired[int | None]
    """When it was given: milliseconds since 1970 by the browser's clock."""

    device: NotRequired[DeviceId | None]

    sequence: NotRequired[int | None]
    """Number that grows with every comment or answer on the device, in all its tabs. Gaps have no
    meaning."""

    waited_by: NotRequired[WaitClock | None]

    waited_millis: NotRequired[int | None]
    """Milliseconds that it waited on the device before this attempt to send it."""

    key: IdempotencyKey
    """Idempotency key, made by the browser. The same key again means the same answer."""

    question: str
    """Id of the question."""

    segment: NotRequired[SegmentId | None]

    session: SessionId
    """Session in which the answer was given."""

    value: AnswerValue
    """Value of the answer."""

class NewChoice(TypedDict):
    """A request to look elsewhere."""

    at: NotRequired[Touch | None]

    follows: NotRequired[bool | None]
    """Whether a place follows the tissue from now on, instead of staying on the screen; none leaves it
    as it is. Only the operator decides it, and only outside sessions."""

    frame: int
    """Number of the frame that was on screen."""

    session: NotRequired[SessionId | None]

NewComment = dict[str, Any]
"""A comment as a surgeon's browser sends it."""

class NewConsent(TypedDict):
    """A consent as the operator's page sends it."""

    given_on: str
    """Day on which the consent was given."""

    medium: Medium
    """Whether the consent was given on paper or on a screen."""

    obtained_by: str
    """Person who obtained the consent: initials or a code."""

    text_version: str
    """Version of the consent text."""

    session: SessionId
    """Session that the consent is for."""

NewCorrection = dict[str, Any]
"""A correction as the researcher's page sends it."""

class NewErasure(TypedDict):
    """An erasure as the researcher's page sends it."""

    reason: str
    """Reason for the erasure; kept with it. It must not repeat the erased words."""

    record: str
    """Key of the record; for a correction or an event, its number."""

    subject: Erasable
    """Kind of record whose words are erased."""

class NewParticipant(TypedDict):
    """A participant to add."""

    code: str
    """2 to 16 capital letters, digits and dashes; never a name."""

class NewSession(TypedDict):
    """A session to prepare."""

    participant: str
    """Code of the participant."""

    protocol: str
    """Name of the protocol."""

    study: NotRequired[StudyPlace | None]

class OpenStudy(TypedDict):
    """A study that accepts new sessions now, for the operator to choose. Says nothing of its policies."""

    protocols: builtins.list[ProtocolSummary]
    """The study's protocols, as they were when it was planned."""

    sites: builtins.list[str]
    """Names of the sites that this database runs."""

    study: str
    """Name of the study."""

    title: str
    """Title of the study."""

class OperatorView(TypedDict):
    """The current session as the operator sees it. It has no policy either, because the operator stands
    beside the surgeon."""

    answers: dict[str, AnswerValue]
    """Saved answers to those questions, by question id."""

    comments: int
    """Number of comments saved so far in this session, without those that were taken back."""

    focus_held: bool
    """Whether the focus is held on request."""

    holding: bool
    """Whether the protocol lets the surgeon hold the focus."""

    language: Language
    """Language of all that the surgeon reads."""

    may_pause: bool
    """Whether the surgeon may pause the session."""

    may_resume: bool
    """Whether the surgeon may resume the session: not after a pause by the operator."""

    paused: bool
    """Whether the session is paused in that phase (by the operator, or by a restart of the server)."""

    paused_by: NotRequired[PauseCause | None]

    phase: Phase
    """Phase of the session."""

    pointing: bool
    """Whether the protocol lets the surgeon choose what is to be in focus."""

    practice: bool
    """Whether this is a practice session."""

    prompt: NotRequired[str | None]
    """Prompt to show now, for example "How does the focus feel now?"; none if none is due."""

    questions: builtins.list[Question]
    """Questions to show in the phases `Questions` and `Closing`."""

    quick_comments: builtins.list[str]
    """Comments that the surgeon can give with one tap."""

    remaining_seconds: NotRequired[float | None]
    """Seconds of inspection left in the segment when the view was sent; none outside inspection."""

    said: builtins.list[builtins.list[str]]
    """The surgeon's own words about each setting, in the order of entry; empty outside the closing
    questions."""

    segment: NotRequired[SegmentId | None]

    session: SessionId
    """Random id of the session."""

    setting: int
    """Number of the current setting, from 1; 0 before the first."""

    settings: int
    """Number of settings in the session."""

    title: str
    """The protocol's title for surgeons."""

    unrecorded: bool
    """Whether the event that last stopped the session or its setting (a pause, an end) is not written
    to disk yet."""

    voice: bool
    """Whether the surgeon may comment aloud."""

    by_hand: NotRequired[float | None]
    """Focal power to which the operator last moved the lens by hand in this pause or after the abort;
    none if nobody did. It is the operator's own, and says nothing of a policy."""

    consent: NotRequired[Consent | None]

    consent_required: NotRequired[str | None]
    """Version of the consent text that the session requires before its start; none if no consent is
    required."""

    latest_comments: builtins.list[CommentLine]
    """The latest comments, newest first."""

    log: builtins.list[LogLine]
    """The latest events in words, newest first."""

    may_focus_by_hand: bool
    """Whether the operator may focus by hand: while the session is paused, and after an abort."""

    participant: str
    """Code of the participant."""

    protocol: str
    """Name of the protocol."""

    reason_wanted: NotRequired[ReasonWanted | None]

    study: NotRequired[str | None]
    """Name of the session's study; none outside studies."""

    unrecorded_because: NotRequired[str | None]
    """Why the `unrecorded` event is not on disk yet; none if that is not known."""

    withdrawn: bool
    """Whether the participant withdrew."""

Order = Literal["shuffled", "balanced"]
"""How a protocol orders its segments."""

class Origin(TypedDict):
    """Device and time of a comment or answer, as the surgeon's page reports them."""

    client_millis: NotRequired[int | None]
    """When it was given: milliseconds since 1970 by the browser's clock."""

    device: NotRequired[DeviceId | None]

    sequence: NotRequired[int | None]
    """Number that grows with every comment or answer on the device, in all its tabs. Gaps have no
    meaning."""

    waited_by: NotRequired[WaitClock | None]

    waited_millis: NotRequired[int | None]
    """Milliseconds that it waited on the device before this attempt to send it."""

class Outcome(TypedDict):
    """A quantity that has a number in each setting."""

    better: NotRequired[str | None]
    """Which end is better, if known: `higher` or `lower`."""

    highest: NotRequired[float | None]
    """Highest possible value; none if there is no limit."""

    label: str
    """Label for people."""

    lowest: NotRequired[float | None]
    """Lowest possible value; none if there is no limit."""

    outcome: str
    """Name: question and measure, or a quantity of the focal power."""

    unit: str
    """Unit or scale."""

class Outstanding(TypedDict):
    """What may still arrive for a session that has ended."""

    counts_until: NotRequired[str | None]
    """Until when, by the server's clock, arrivals count; none once that time is over."""

    devices: int
    """Number of surgeons' devices that have not reported since the end that they hold nothing more."""

class Pair(TypedDict):
    """Two scales of a questionnaire, of which the surgeon chooses one. Scales are numbered from 0."""

    first: int
    """Scale that is offered first."""

    second: int
    """Scale that is offered second."""

PauseCause = Literal["operator", "surgeon", "restart", "tablet-away", "small-picture"]
"""What paused a session. The surgeon can resume it too, unless it was the operator."""

PauseSpan = TypedDict("PauseSpan", {"from": "float", "reason": "str", "to": "NotRequired[float | None]"})
"""When the session was paused, by a person or by a restart of the server."""

PermutationMethod = Literal["exact", "monte-carlo"]
"""How a p over permutations was computed."""

Phase = Literal["ready", "notice", "inspecting", "questions", "closing", "completed", "aborted"]
"""The phase of a session."""

class PictureSize(TypedDict):
    """The size of a picture, in pixels."""

    height: int
    """Height."""

    width: int
    """Width."""

class PlaceRules(TypedDict):
    """Rules for the places of aborted and withdrawn sessions, and for repeated sessions."""

    aborted: Replacement
    """What happens to the place of an aborted session."""

    repeated: Repetition
    """Whether a surgeon may have a second session with the same protocol."""

    withdrawn: Replacement
    """What happens to the place of a session whose surgeon withdrew."""

class PlaceSpectrum(TypedDict):
    """The spectrum at a place."""

    bands: builtins.list[BandLevel]
    """The bands in order of wavelength."""

    cells: int
    """Number of mosaic cells within the circle."""

    saturated: int
    """Samples at full scale, whose true values are higher."""

class PlanStudy(TypedDict):
    """A study to plan."""

    definition: str
    """The definition in TOML, as docs/study.md describes it."""

    reason: str
    """The reason, which is signed."""

    sites: NotRequired[builtins.list[str]]
    """The sites of the study that this database runs; all sites if none are named."""

class PolicyPair(TypedDict):
    """Two policies compared by the surgeons' means."""

    a: str
    """The first policy."""

    b: str
    """The second policy."""

    differing: int
    """Number of surgeons whose means differ; a signed-rank test ignores the others."""

    mean_difference: float
    """Mean of `a` minus mean of `b`."""

    mean_difference_interval: NotRequired[Interval | None]

    median_difference: float
    """Median of the surgeons' differences."""

    method: Method
    """How `p` was computed."""

    n: int
    """Number of surgeons compared."""

    negative: float
    """Sum of the ranks where `b` is higher."""

    p: float
    """Two-sided p of Wilcoxon's signed-rank test."""

    p_holm: float
    """`p` corrected by Holm's method for the pairs of this outcome."""

    positive: float
    """Sum of the ranks where `a` is higher."""

    rank_biserial: NotRequired[float | None]
    """Rank-biserial correlation, -1..=1: above 0 if `a` is higher; none if no surgeon's means differ."""

    rank_biserial_interval: NotRequired[Interval | None]

    said: str
    """The finding in a sentence."""

class PolicySummary(TypedDict):
    """Summary of a policy's values."""

    mean: NotRequired[float | None]
    """Mean; none without values."""

    median: NotRequired[float | None]
    """Median; none without values."""

    n: int
    """Number of values."""

    sd: NotRequired[float | None]
    """Standard deviation of the sample (divided by n - 1); none for fewer than two values."""

    missing: int
    """Number of settings without a value."""

    policy: str
    """The policy."""

class Position(TypedDict):
    """Whether values rise or fall with the position in the session."""

    means: builtins.list[float]
    """The mean over these sessions at each position."""

    said: str
    """The finding in a sentence, or why there is none."""

    sessions: int
    """Number of sessions without a missing value."""

    trend: NotRequired[Trend | None]

class Problem(TypedDict):
    """One thing that is wrong."""

    code: Code
    """What it is, for programs."""

    condition: Condition
    """Severity: `degraded` or `failing`."""

    message: str
    """What it is, in one sentence for people."""

class ProtocolAnalysis(TypedDict):
    """The analysis of a protocol's sessions."""

    by_site: builtins.list[SiteAnalysis]
    """The same for each site alone; empty if all sessions that count are of one site."""

    notes: builtins.list[str]
    """Notes that apply to this protocol's figures."""

    outcomes: builtins.list[Comparison]
    """The outcomes, compared between the policies, over all sites."""

    policies: builtins.list[str]
    """Names of the policies."""

    protocol: str
    """Name of the protocol."""

    repeats: int
    """Number of settings of each policy in a session."""

    researcher_title: str
    """Title of the protocol for researchers."""

    sessions: builtins.list[AnalysedSession]
    """The sessions with this protocol, and whether each counts."""

    surgeons: int
    """Number of surgeons whose sessions count."""

    values: builtins.list[Any]
    """Every value that was compared."""

    whole_sessions: builtins.list[WholeSessions]
    """Answers about sessions as a whole, which cannot be assigned to a policy."""

    words: builtins.list[SurgeonWords]
    """Comments and answers in words."""

class ProtocolSummary(TypedDict):
    """A protocol for the operator to choose. Says nothing of its policies, because the operator stands
    beside the surgeon."""

    name: str
    """Name of the protocol."""

    practice: bool
    """Whether its sessions are practice."""

    researcher_title: str
    """Title for operators and researchers."""

    segment_seconds: int
    """Longest inspection of a setting, seconds."""

    settings: int
    """Settings in a session."""

    title: str
    """Title for surgeons."""

Question = dict[str, Any]
"""A question of the protocol."""

QuestionKind = dict[str, Any]
"""The kinds of question, by the answers that they take."""

class ReasonWanted(TypedDict):
    """A pause whose reason can still be given."""

    at: str
    """Time of the pause, by the server's wall clock."""

    by: Role
    """Role that paused the session."""

    event: int
    """Number of the pause among the session's events."""

Record = Literal["none", "view", "mosaic"]
"""What is recorded during a session, from its start to its end."""

RecordingCourse = TypedDict("RecordingCourse", {"from": "float", "kind": "RecordingKind", "name": "str", "times_ms": "builtins.list[int]"})
"""A recording, with the times at which its frames were exposed."""

RecordingKind = Literal["mosaic", "view"]
"""What a recording is made of."""

class RecordingOrder(TypedDict):
    """Whether to start or to stop recording."""

    record: bool
    """True to start recording mosaics, false to stop."""

class RecordingStatus(TypedDict):
    """State of recording. Sizes depend only on the picture, which the operator sees anyway."""

    by_protocol: bool
    """Whether the session's protocol asked for it."""

    bytes: int
    """Bytes recorded."""

    bytes_per_second: NotRequired[float | None]
    """Bytes a second, as measured; while nothing is recorded, what recording mosaics would take."""

    folder: NotRequired[str | None]
    """Name of its folder, below `recordings` in the data folder."""

    frames: int
    """Frames recorded."""

    free_bytes: NotRequired[int | None]
    """Bytes free on the disk."""

    lost: int
    """Frames lost, because this machine or its disk was too slow."""

    notice: NotRequired[str | None]
    """How the last recording ended, or why it did not start."""

    notice_warns: bool
    """Whether `notice` is a warning: frames were lost, or a recording did not begin or ended by
    itself."""

    recording: NotRequired[Record | None]

    reserve_bytes: NotRequired[int | None]
    """Bytes of these that recordings leave free."""

    seconds: NotRequired[float | None]
    """Seconds since it began."""

    seconds_left: NotRequired[float | None]
    """Seconds after which a recording would stop by itself."""

    unavailable: NotRequired[str | None]
    """Why the operator cannot record; none if recording is possible."""

class Repeats(TypedDict):
    """How far repeats of a policy agree within a session."""

    agreement: NotRequired[Agreement | None]

    said: str
    """The finding in a sentence, or why there is none."""

    subjects: int
    """Number of subjects; a subject is a policy in a session without missing values."""

Repetition = Literal["refuse", "next-spare"]
"""Whether a surgeon who already has a session with a protocol may have another one."""

Replacement = Literal["keep", "same-place", "next-spare"]
"""What happens to the place of a session that was aborted or withdrawn."""

Role = Literal["surgeon", "operator", "researcher", "system"]
"""The role in which somebody acts; kept with every event."""

class Scale(TypedDict):
    """A scale of a questionnaire."""

    high: str
    """Meaning of the upper end."""

    low: str
    """Meaning of the lower end."""

    name: str
    """Name of the scale in exports: lower-case letters and dashes."""

    text: str
    """The question about this scale."""

    title: str
    """Name of the scale as the surgeon reads it."""

SegmentId = str
"""One segment of a session. Random, so that two segments of one policy share nothing."""

class SessionDetail(TypedDict):
    """A session in detail, for the researcher. Contains the policies only after it was unblinded."""

    comments: int
    """Number of comments that the surgeon did not take back."""

    corrected_participant: NotRequired[str | None]
    """Corrected code of the participant; none if it was not corrected, or back to the first one."""

    created: str
    """When the session was made, by the server's wall clock."""

    emergency: bool
    """Whether it was unblinded in an emergency: while it was under way, or while its study was
    blinded."""

    finished_settings: int
    """Number of settings inspected to the end."""

    participant: str
    """Code of the participant, as it was recorded."""

    practice: bool
    """Whether it is a practice session."""

    protocol: str
    """Name of the protocol."""

    session: SessionId
    """Session."""

    settings: int
    """Number of settings in the session."""

    status: SessionStatus
    """State of the session."""

    study: NotRequired[str | None]
    """The study that it belongs to; none if it belongs to none."""

    unblinded: bool
    """Whether it was unblinded."""

    withdrawn: bool
    """Whether the participant withdrew: its data stay out of exports."""

    algorithm: str
    """Algorithm that drew the order."""

    answers: builtins.list[AnswerLine]
    """Answers that count, in the order of entry; none once the participant has withdrawn."""

    commitment: str
    """SHA-256 published when the session was made, which commits to the order."""

    consents: builtins.list[ConsentLine]
    """The participant's consents, oldest first; the latest counts."""

    corrections: builtins.list[CorrectionLine]
    """Corrections, oldest first. Once the participant has withdrawn, only those of the participant."""

    counts_until: NotRequired[str | None]
    """Time, by the server's clock, until which arriving comments and answers count; none while the
    session is under way."""

    log: builtins.list[LogLine]
    """Everything that happened, oldest first."""

    outstanding: NotRequired[Outstanding | None]

    researcher_title: str
    """The protocol's title for researchers."""

    settings_detail: builtins.list[SettingDetail]
    """The session's settings, in order."""

    unblinding: NotRequired[Unblinding | None]

    withdrawal: NotRequired[WithdrawalLine | None]

SessionId = str
"""A trial session. Random."""

class SessionLine(TypedDict):
    """A session in a list. Says nothing of policies."""

    comments: int
    """Number of comments that the surgeon did not take back."""

    corrected_participant: NotRequired[str | None]
    """Corrected code of the participant; none if it was not corrected, or back to the first one."""

    created: str
    """When the session was made, by the server's wall clock."""

    emergency: bool
    """Whether it was unblinded in an emergency: while it was under way, or while its study was
    blinded."""

    finished_settings: int
    """Number of settings inspected to the end."""

    participant: str
    """Code of the participant, as it was recorded."""

    practice: bool
    """Whether it is a practice session."""

    protocol: str
    """Name of the protocol."""

    session: SessionId
    """Session."""

    settings: int
    """Number of settings in the session."""

    status: SessionStatus
    """State of the session."""

    study: NotRequired[str | None]
    """The study that it belongs to; none if it belongs to none."""

    unblinded: bool
    """Whether it was unblinded."""

    withdrawn: bool
    """Whether the participant withdrew: its data stay out of exports."""

class SessionRecordings(TypedDict):
    """The recordings of a session that can be played."""

    problems: builtins.list[str]
    """Problems with other recordings, and parts missing from these, in sentences."""

    recordings: builtins.list[RecordingCourse]
    """Recordings that can be played, in the order in which they were made."""

SessionStatus = Literal["under-way", "completed", "aborted"]
"""Whether a session is under way, completed or aborted."""

class SetAside(TypedDict):
    """An answer that does not count: a later one from another device differs, or it arrived too late."""

    at: str
    """When it was stored, by the server's wall clock."""

    counted: NotRequired[AnswerValue | None]

    key: IdempotencyKey
    """The answer's key."""

    late: bool
    """Whether it arrived too late."""

    question: str
    """The question's identifier."""

    seconds: float
    """When the answer was given, in seconds: the time that it waited on the surgeon's device is
    subtracted."""

    setting: NotRequired[int | None]
    """Setting, from 1; none for a closing question."""

    text: str
    """The question's text."""

    value: AnswerValue
    """The answer."""

Setting = Literal["exposure", "gain", "frame-rate"]
"""A setting of a camera."""

class SettingDetail(TypedDict):
    """A setting of a session."""

    inspected_seconds: NotRequired[float | None]
    """Time inspected without pauses, in seconds; none until the inspection is over."""

    segment: SegmentId
    """Identifier of the segment."""

    setting: int
    """Number of the setting, from 1."""

    started: NotRequired[str | None]
    """When inspection began, by the server's wall clock."""

SettingSpan = TypedDict("SettingSpan", {"from": "float", "setting": "int", "to": "NotRequired[float | None]"})
"""When a setting was inspected."""

class SettingWords(TypedDict):
    """The words in a setting, or outside all settings of a session."""

    policy: NotRequired[str | None]
    """The policy that ran; none outside settings."""

    session: SessionId
    """The session."""

    setting: NotRequired[int | None]
    """The setting, from 1; none outside settings."""

    words: builtins.list[Words]
    """The words, in order."""

class Sight(TypedDict):
    """What a surgeon saw when a comment was made, as the page counted it. A slow link makes pictures
    smaller and fewer, so “blurred” may be said of the link."""

    picture_width: NotRequired[int | None]
    """Width of the picture on screen, pixels."""

    pictures_per_second: NotRequired[float | None]
    """Pictures drawn a second."""

SightSpan = TypedDict("SightSpan", {"height": "int", "width": "int", "from": "float", "per_second": "float", "to": "float"})
"""What the surgeon saw for a while."""

class SignIn(TypedDict):
    """A request to sign in."""

    as_bearer: NotRequired[bool]
    """Whether the answer contains the token, for a program, instead of setting a cookie."""

    name: str
    """The account's name."""

    new_passphrase: NotRequired[str | None]
    """A new passphrase that replaces it: needed if a lead set the current one."""

    passphrase: str
    """The account's passphrase."""

class SignedInAs(TypedDict):
    """The answer after signing in."""

    account: AccountName
    """The name that the person signs in with."""

    disabled: bool
    """Whether the account is disabled: nobody can sign in to it."""

    display: str
    """The person's name, as signatures show it."""

    role: AccountRole
    """The role, which decides what the person may do."""

    home: str
    """The page of the account's role."""

    token: NotRequired[str | None]
    """The token, to be sent as `Authorization: Bearer`, if it was asked for."""

class Site(TypedDict):
    """A site of a study."""

    name: str
    """Name of the site: lower-case letters, digits and dashes."""

    spares: int
    """Number of spare places at the end of each list. The rules open them one by one."""

    surgeons: int
    """Number of surgeons planned: places of each list that are open from the beginning."""

    title: str
    """Title of the site."""

class SiteAnalysis(TypedDict):
    """The figures of one site's sessions."""

    outcomes: builtins.list[Comparison]
    """The outcomes, compared between the policies."""

    sessions: int
    """Number of its sessions that count."""

    site: str
    """Name of the site."""

    surgeons: int
    """Number of its surgeons whose sessions count."""

    whole_sessions: builtins.list[WholeSessions]
    """Answers about sessions as a whole."""

class SiteDetail(TypedDict):
    """A site of a study."""

    name: str
    """Name of the site: lower-case letters, digits and dashes."""

    spares: int
    """Number of spare places at the end of each list. The rules open them one by one."""

    surgeons: int
    """Number of surgeons planned: places of each list that are open from the beginning."""

    title: str
    """Title of the site."""

    here: bool
    """Whether this database runs the site."""

    sessions: int
    """Number of sessions made at the site."""

Stage = Literal["planned", "open", "closed", "locked", "unblinded"]
"""The stage of a study."""

StudyAction = dict[str, Any]
"""A change to a study that a person requests."""

class StudyDetail(TypedDict):
    """A study in detail."""

    sessions: int
    """Number of sessions made in it."""

    stage: Stage
    """Stage of the study, from planned to unblinded."""

    study: str
    """Name of the study."""

    surgeons: int
    """Number of surgeons planned at the sites that this database runs."""

    title: str
    """Title of the study."""

    analysis: str
    """The planned analysis."""

    commitment_line: NotRequired[str | None]
    """The line to print, publish or mail before the first session; none until the orders are drawn."""

    concerns: builtins.list[str]
    """Concerns about the plan, in sentences; empty once the study is open."""

    definition: str
    """The definition, byte for byte."""

    definition_sha256: str
    """SHA-256 of the definition: the same at every site."""

    log: builtins.list[StudyLogLine]
    """The study's events, oldest first."""

    may_unblind: builtins.list[str]
    """Names of the people who may unblind the whole study."""

    order: Order
    """How sessions are ordered, the same as in each protocol."""

    outstanding: int
    """Number of sessions for which a surgeon's device may still hold something that would not count
    after locking. 0 unless the study is closed."""

    protocols: builtins.list[StudyProtocol]
    """The study's protocols."""

    rules: PlaceRules
    """Rules for the place of an aborted or withdrawn session."""

    sites: builtins.list[SiteDetail]
    """The study's sites."""

    study_sessions: builtins.list[StudySession]
    """The study's sessions, in the order in which they were made."""

    when_used_up: str
    """What to do when a list is used up."""

class StudyExportProgress(TypedDict):
    """The progress of an export."""

    exported: int
    """Number of sessions that are exported and verified."""

    joined: int
    """Number of steps for joining that are done."""

    sessions: int
    """Number of sessions to export."""

    steps: int
    """Number of steps for joining the sessions; 0 until all sessions are exported."""

StudyExportState = dict[str, Any]
"""The state of a study's latest export."""

class StudyLine(TypedDict):
    """A study in a list."""

    sessions: int
    """Number of sessions made in it."""

    stage: Stage
    """Stage of the study, from planned to unblinded."""

    study: str
    """Name of the study."""

    surgeons: int
    """Number of surgeons planned at the sites that this database runs."""

    title: str
    """Title of the study."""

class StudyLogLine(TypedDict):
    """An event of a study in words."""

    at: str
    """When it happened, by the wall clock."""

    by: str
    """How the event was recorded: by a role, or on the command line."""

    person: str
    """Name of the person, as given in the signature."""

    reason: str
    """Reason for the change."""

    text: str
    """What happened."""

class StudyPlace(TypedDict):
    """A study and the site at which a session is made."""

    site: str
    """The site's name."""

    study: str
    """The study's name."""

class StudyProtocol(TypedDict):
    """A protocol of a study."""

    name: str
    """Name of the protocol."""

    sha256: str
    """SHA-256 of the protocol's text."""

class StudySession(TypedDict):
    """A session of a study."""

    corrected_participant: NotRequired[str | None]
    """The corrected code; none if it was not corrected, or back to the first one."""

    participant: str
    """The participant's code."""

    place: int
    """Place in the list of this site and protocol, from 1."""

    protocol: str
    """Name of the protocol."""

    session: SessionId
    """The session."""

    site: str
    """Name of the site."""

    status: SessionStatus
    """State of the session."""

    unblinded: bool
    """Whether the session's policies were revealed."""

    withdrawn: bool
    """Whether the surgeon withdrew."""

class Summary(TypedDict):
    """Summary of a sample."""

    mean: NotRequired[float | None]
    """Mean; none without values."""

    median: NotRequired[float | None]
    """Median; none without values."""

    n: int
    """Number of values."""

    sd: NotRequired[float | None]
    """Standard deviation of the sample (divided by n - 1); none for fewer than two values."""

class SurgeonLink(TypedDict):
    """The surgeon's link, as text and as a QR code."""

    link: str
    """The link."""

    qr: str
    """The link as a QR code in SVG."""

    session: NotRequired[SessionId | None]

class SurgeonMeans(TypedDict):
    """A surgeon's mean of each policy."""

    means: builtins.list[float | None]
    """The mean over the settings of each policy, in the order of `policies`; none if a value is
    missing."""

    surgeon: str
    """The surgeon's code."""

class SurgeonView(TypedDict):
    """A session as the surgeon's browser gets it. Nothing in it depends on the policy."""

    answers: dict[str, AnswerValue]
    """Saved answers to those questions, by question id."""

    comments: int
    """Number of comments saved so far in this session, without those that were taken back."""

    focus_held: bool
    """Whether the focus is held on request."""

    holding: bool
    """Whether the protocol lets the surgeon hold the focus."""

    language: Language
    """Language of all that the surgeon reads."""

    may_pause: bool
    """Whether the surgeon may pause the session."""

    may_resume: bool
    """Whether the surgeon may resume the session: not after a pause by the operator."""

    paused: bool
    """Whether the session is paused in that phase (by the operator, or by a restart of the server)."""

    paused_by: NotRequired[PauseCause | None]

    phase: Phase
    """Phase of the session."""

    pointing: bool
    """Whether the protocol lets the surgeon choose what is to be in focus."""

    practice: bool
    """Whether this is a practice session."""

    prompt: NotRequired[str | None]
    """Prompt to show now, for example "How does the focus feel now?"; none if none is due."""

    questions: builtins.list[Question]
    """Questions to show in the phases `Questions` and `Closing`."""

    quick_comments: builtins.list[str]
    """Comments that the surgeon can give with one tap."""

    remaining_seconds: NotRequired[float | None]
    """Seconds of inspection left in the segment when the view was sent; none outside inspection."""

    said: builtins.list[builtins.list[str]]
    """The surgeon's own words about each setting, in the order of entry; empty outside the closing
    questions."""

    segment: NotRequired[SegmentId | None]

    session: SessionId
    """Random id of the session."""

    setting: int
    """Number of the current setting, from 1; 0 before the first."""

    settings: int
    """Number of settings in the session."""

    title: str
    """The protocol's title for surgeons."""

    unrecorded: bool
    """Whether the event that last stopped the session or its setting (a pause, an end) is not written
    to disk yet."""

    voice: bool
    """Whether the surgeon may comment aloud."""

class SurgeonWords(TypedDict):
    """A surgeon's words in the sessions that count."""

    settings: builtins.list[SettingWords]
    """The words by setting; those outside settings come last in each session."""

    surgeon: str
    """The surgeon's code."""

TabletPart = Literal["encrypted", "storage", "disk", "stream", "picture", "microphone", "screen-on"]
"""Something that a trial needs of a tablet."""

class TabletTrial(TypedDict):
    """What a tablet found out about itself."""

    device: DeviceId
    """The tablet."""

    tried: builtins.list[TriedPart]
    """What was tried."""

class Timeline(TypedDict):
    """A session over time. Seconds count from its start by the server's clocks, pauses included."""

    absences: builtins.list[PauseSpan]
    """When no tablet showed the surgeon's page."""

    choices: builtins.list[TimelineChoice]
    """When somebody chose what is to be in focus."""

    comments: builtins.list[TimelineComment]
    """The comments."""

    holds: builtins.list[HoldSpan]
    """When the focus was held on request."""

    patch_stays: bool
    """Whether a choice stays in the settings that follow. Otherwise each setting begins at the centre."""

    pauses: builtins.list[PauseSpan]
    """When the session was paused and the lens held where it was."""

    points: builtins.list[TimelinePoint]
    """The focal path."""

    set_aside: builtins.list[SetAside]
    """Answers that do not count, although they are their device's latest."""

    settings: builtins.list[SettingSpan]
    """When each setting was inspected."""

    sights: builtins.list[SightSpan]
    """What size of picture the surgeon saw, and how many."""

class TimelineChoice(TypedDict):
    """A choice of what is to be in focus."""

    frame: int
    """Number of the frame that was on screen."""

    seconds: float
    """When it was made, in seconds."""

    x: NotRequired[float | None]
    """Where the picture was touched, in mosaic cells from its left edge; none for the centre of the
    bright circle."""

    y: NotRequired[float | None]
    """Where the picture was touched, in mosaic cells from its top edge; none for the centre of the
    bright circle."""

TimelineComment = dict[str, Any]
"""A comment on the timeline."""

class TimelinePoint(TypedDict):
    """A point of the focal path."""

    asked: float
    """Requested focal power, 0 to 1."""

    frame: int
    """Number of the frame."""

    measured: NotRequired[float | None]
    """Focal power at which the frame was exposed, 0 to 1."""

    metric: NotRequired[float | None]
    """The policy's focus metric, on a scale of its own; only after the session was unblinded."""

    optimal: NotRequired[float | None]
    """The optimum, 0 to 1, if a simulation knows it."""

    patch_x: int
    """Left column of the patch, in mosaic cells."""

    patch_y: int
    """Top row of the patch, in mosaic cells."""

    seconds: float
    """When the frame was exposed, in seconds."""

    setting: int
    """Setting, from 1."""

class TimelineVoice(TypedDict):
    """The recording of a voice comment."""

    ended: NotRequired[Ending | None]

    media_type: NotRequired[str | None]
    """Media type; none until a part of the recording has arrived."""

    missing: int
    """Number of pieces, of about a second each, that have not arrived although later ones have."""

    seconds: float
    """Length in seconds."""

class Touch(TypedDict):
    """Where a picture was touched."""

    x: float
    """Mosaic cells from the picture's left edge."""

    y: float
    """Mosaic cells from the picture's top edge."""

class Trend(TypedDict):
    """Result of Page's test."""

    expected: float
    """Mean of L if there is no trend."""

    l: float
    """Page's L: the sum over treatments of place times rank sum."""

    method: Method
    """How `p` was computed."""

    p: float
    """Two-sided p."""

class TriedPart(TypedDict):
    """One thing that was tried on a tablet."""

    part: TabletPart
    """What was tried."""

    works: bool
    """Whether it works."""

class Unblind(TypedDict):
    """A request to unblind a session."""

    despite_outstanding: NotRequired[bool]
    """Whether to unblind even though something may be outstanding, which would then no longer count."""

    passphrase: NotRequired[str | None]
    """The passphrase of the lead who is signed in, entered again: needed for a session of a study."""

    reason: str
    """Why; stored in the audit trail."""

class Unblinding(TypedDict):
    """What unblinding revealed."""

    at: str
    """When, by the server's wall clock."""

    emergency: bool
    """Whether it was an emergency: the session was under way, or its study was blinded."""

    policies: builtins.list[str]
    """The policy of each setting, in order."""

    reason: str
    """Reason for the unblinding."""

Verdict = Literal["well", "advice", "wrong"]
"""The result of a check."""

WaitClock = Literal["page-clock", "wall-clock"]
"""The clock with which a page measured how long a comment or answer waited."""

class WholeSessions(TypedDict):
    """The answers to a closing question."""

    better: NotRequired[str | None]
    """Which end is better, if known: `higher` or `lower`."""

    highest: NotRequired[float | None]
    """Highest possible value; none if there is no limit."""

    label: str
    """Label for people."""

    lowest: NotRequired[float | None]
    """Lowest possible value; none if there is no limit."""

    outcome: str
    """Name: question and measure, or a quantity of the focal power."""

    unit: str
    """Unit or scale."""

    mean: NotRequired[float | None]
    """Mean; none without values."""

    median: NotRequired[float | None]
    """Median; none without values."""

    n: int
    """Number of values."""

    sd: NotRequired[float | None]
    """Standard deviation of the sample (divided by n - 1); none for fewer than two values."""

    missing: int
    """Number of sessions without an answer."""

class Withdraw(TypedDict):
    """A participant's withdrawal."""

    reason: str
    """Why the participant withdrew; stored in the audit trail."""

class WithdrawalLine(TypedDict):
    """A withdrawal, as it is shown."""

    account: NotRequired[str | None]
    """The personal account of the person who recorded it, if signed in."""

    at: str
    """When it was recorded, by the server's wall clock."""

    by: Role
    """Role that recorded it."""

    reason: str
    """Reason for the withdrawal."""

    words_left: int
    """Number of comments, answers in words and notes that nobody has erased from the database yet."""

class Words(TypedDict):
    """A comment or an answer in words."""

    erased: bool
    """Whether its words were erased."""

    late: bool
    """Whether it arrived too late to count."""

    question: NotRequired[str | None]
    """The question that it answers; none for a comment."""

    text: str
    """The words; empty if they were erased."""

class AccountsRequests:
    """Requests of the group "accounts"."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._call = call

    def list(self) -> builtins.list[AccountLine]:
        """All accounts, by name."""
        return self._call("GET", "/api/researcher/accounts")

    def make(self, *, account: str, display: str, first_passphrase: str, passphrase: str, role: AccountRole) -> Account:
        """Makes an account. Its person chooses another passphrase at the first sign-in."""
        return self._call("POST", "/api/researcher/accounts", body={"account": account, "display": display, "first_passphrase": first_passphrase, "passphrase": passphrase, "role": role})

    def change(self, account: str | int, *, passphrase: str, **fields: Any) -> builtins.list[AccountLine]:
        """Changes an account."""
        return self._call("POST", f"/api/researcher/accounts/{account}/changes", body={"passphrase": passphrase, **fields})

    def backup_state(self) -> BackupState:
        """The state of the latest backup that the lead who is signed in asked for. It is kept for 15
        minutes, unless words are erased."""
        return self._call("GET", "/api/researcher/backup")

    def start_backup(self, *, passphrase: str) -> BackupState:
        """Begins to make a backup in the background, and records that. If one is being made already,
        no other begins."""
        return self._call("POST", "/api/researcher/backup", body={"passphrase": passphrase})

    def backup_file(self) -> bytes:
        """The backup as a file for `parfocal restore`."""
        return self._call("GET", "/api/researcher/backup.db", answer="bytes")

    def sign_in(self, *, name: str, passphrase: str, as_bearer: bool | None = None, new_passphrase: str | None = None) -> SignedInAs:
        """Signs in. The answer takes longer after failed attempts."""
        return self._call("POST", "/api/sign-in", body={"as_bearer": as_bearer, "name": name, "new_passphrase": new_passphrase, "passphrase": passphrase})

    def sign_out(self) -> None:
        """Signs out: the token is no longer valid. Signing out again changes nothing."""
        return self._call("POST", "/api/sign-out", answer="nothing")

class OperatorRequests:
    """Requests of the group "operator"."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._call = call

    def act(self, *, session: SessionId, **fields: Any) -> OperatorView | None:
        """Advances the session; repeating an action changes nothing. Returns the session after the
        action."""
        return self._call("POST", "/api/operator/actions", body={"session": session, **fields})

    def offer(self) -> CameraOffer:
        """What can be changed now, with the camera's own bounds. Empty for a camera without such
        settings, or one that is disconnected."""
        return self._call("GET", "/api/operator/camera")

    def change(self, *, setting: Setting, value: float) -> None:
        """Changes a setting before the next frame."""
        return self._call("POST", "/api/operator/camera", answer="nothing", body={"setting": setting, "value": value})

    def checks(self) -> Checks:
        """Whether everything is ready for a trial."""
        return self._call("GET", "/api/operator/checks")

    def choices(self) -> Choices:
        """What the operator can choose from."""
        return self._call("GET", "/api/operator/choices")

    def consent(self, *, given_on: str, medium: Medium, obtained_by: str, text_version: str, session: SessionId) -> OperatorView | None:
        """Records a participant's consent. Returns the session after that."""
        return self._call("POST", "/api/operator/consents", body={"given_on": given_on, "medium": medium, "obtained_by": obtained_by, "text_version": text_version, "session": session})

    def dismiss(self, *, session: SessionId) -> OperatorView | None:
        """Takes an ended session off the screens, so that the next can be prepared."""
        return self._call("POST", "/api/operator/dismissals", body={"session": session})

    def focus(self, **fields: Any) -> None:
        """Puts a policy in charge of the focus, or sets the focal power by hand. While a session is
        under way only the latter, and only while it is paused or after an abort; that is recorded
        in the session."""
        return self._call("POST", "/api/operator/focus", answer="nothing", body={**fields})

    def add_participant(self, *, code: str) -> builtins.list[str]:
        """Adds a participant; one that exists already stays as it is. Answers with all codes."""
        return self._call("POST", "/api/operator/participants", body={"code": code})

    def patch(self, *, frame: int, at: Touch | None = None, follows: bool | None = None, session: SessionId | None = None) -> None:
        """Points the focus at a place in the picture, or back at the centre. In a session it is
        recorded, and only while a setting is inspected whose protocol lets the surgeon point."""
        return self._call("POST", "/api/operator/patch", answer="nothing", body={"at": at, "follows": follows, "frame": frame, "session": session})

    def status(self) -> RecordingStatus:
        """The state of recording, and how long the disk will last."""
        return self._call("GET", "/api/operator/recording")

    def order(self, *, record: bool) -> RecordingStatus:
        """Starts or stops recording. Stopping again changes nothing. Answers with the new state of
        recording."""
        return self._call("POST", "/api/operator/recording", body={"record": record})

    def session(self) -> OperatorView | None:
        """The session under way; null if there is none."""
        return self._call("GET", "/api/operator/session")

    def create(self, *, participant: str, protocol: str, study: StudyPlace | None = None) -> OperatorView | None:
        """Prepares a session: draws its order, or takes the next place of its study's list, and waits
        for its start."""
        return self._call("POST", "/api/operator/sessions", body={"participant": participant, "protocol": protocol, "study": study})

    def spectra(self, *, places: builtins.list[LivePlace]) -> LiveSpectra:
        """The spectra at places of the camera's next frame. Not while a session is under way."""
        return self._call("POST", "/api/operator/spectra", body={"places": places})

    def link(self) -> SurgeonLink:
        """The surgeon's link. In a session of a study it is valid only for that session, and ends with
        it."""
        return self._call("GET", "/api/operator/surgeon-link")

class ResearcherRequests:
    """Requests of the group "researcher"."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._call = call

    def list(self) -> builtins.list[SessionLine]:
        """The sessions, newest first, including practice sessions, which are marked."""
        return self._call("GET", "/api/researcher/sessions")

    def session(self, session: str | int) -> SessionDetail:
        """One session in detail; with its policies once it is unblinded."""
        return self._call("GET", f"/api/researcher/sessions/{session}")

    def correct(self, session: str | int, *, reason: str, **fields: Any) -> None:
        """Corrects a record of a session that has ended. The original stays; the correction is kept
        beside it."""
        return self._call("POST", f"/api/researcher/sessions/{session}/corrections", answer="nothing", body={"reason": reason, **fields})

    def course(self, session: str | int) -> Timeline:
        """One session over time, without its focal path."""
        return self._call("GET", f"/api/researcher/sessions/{session}/course")

    def erase(self, session: str | int, *, reason: str, record: str, subject: Erasable) -> None:
        """Erases words permanently. Once this has answered, they are nowhere in the database. Their
        record and its hash stay."""
        return self._call("POST", f"/api/researcher/sessions/{session}/erasures", answer="nothing", body={"reason": reason, "record": record, "subject": subject})

    def erase_all(self, session: str | int, *, reason: str) -> None:
        """Erases all words of a withdrawn session permanently: comments with their sound, answers in
        words, and notes. Once this has answered, they are nowhere in the database. Their records
        and hashes stay."""
        return self._call("POST", f"/api/researcher/sessions/{session}/erasures/all", answer="nothing", body={"reason": reason})

    def zip(self, session: str | int, *, unblinded: bool | None = None) -> bytes:
        """A session's export as one ZIP file: CSV, JSON, a data dictionary, checksums. The same as
        `parfocal export` writes."""
        return self._call("GET", f"/api/researcher/sessions/{session}/export.zip", answer="bytes", query={"unblinded": unblinded})

    def recordings(self, session: str | int) -> SessionRecordings:
        """The recordings of an unblinded session, with the times of their frames. Each access is
        recorded."""
        return self._call("GET", f"/api/researcher/sessions/{session}/recordings")

    def frame(self, session: str | int, recording: str | int, frame: str | int, *, size: Literal["cell", "half"] | None = None) -> bytes:
        """A frame of a recording of an unblinded session. Frames count from 0."""
        return self._call("GET", f"/api/researcher/sessions/{session}/recordings/{recording}/frames/{frame}", answer="bytes", query={"size": size})

    def spectrum(self, session: str | int, recording: str | int, frame: str | int, *, x: float, y: float, radius: float | None = None) -> PlaceSpectrum:
        """The spectrum at a place of a recorded mosaic of an unblinded session. Frames count from 0."""
        return self._call("GET", f"/api/researcher/sessions/{session}/recordings/{recording}/frames/{frame}/spectrum", query={"x": x, "y": y, "radius": radius})

    def timeline(self, session: str | int) -> Timeline:
        """One session over time with its focal path. The path may tell policies apart, so each access
        is recorded."""
        return self._call("GET", f"/api/researcher/sessions/{session}/timeline")

    def unblind(self, session: str | int, *, reason: str, despite_outstanding: bool | None = None, passphrase: str | None = None) -> None:
        """Unblinds a session. If it is still under way, or belongs to a study that is still blinded,
        this is emergency unblinding and permanently marked as such."""
        return self._call("POST", f"/api/researcher/sessions/{session}/unblind", answer="nothing", body={"despite_outstanding": despite_outstanding, "passphrase": passphrase, "reason": reason})

    def recording(self, session: str | int, comment: str | int) -> bytes:
        """The sound of a voice comment, as far as it has arrived, for a player: with its duration,
        which browsers do not write into what they record. Exports have it as it arrived. A request
        for a range of bytes gets that range."""
        return self._call("GET", f"/api/researcher/sessions/{session}/voice/{comment}", answer="bytes")

    def withdraw(self, session: str | int, *, reason: str) -> None:
        """Records that the participant withdrew: from now on the session's data are not shown,
        analysed or exported."""
        return self._call("POST", f"/api/researcher/sessions/{session}/withdraw", answer="nothing", body={"reason": reason})

    def list_studies(self) -> builtins.list[StudyLine]:
        """The studies, in the order in which they were planned."""
        return self._call("GET", "/api/researcher/studies")

    def plan_study(self, *, definition: str, reason: str, sites: builtins.list[str] | None = None) -> StudyDetail:
        """Plans a study."""
        return self._call("POST", "/api/researcher/studies", body={"definition": definition, "reason": reason, "sites": sites})

    def study(self, study: str | int) -> StudyDetail:
        """One study in detail, without the orders."""
        return self._call("GET", f"/api/researcher/studies/{study}")

    def analysis(self, study: str | int) -> Analysis:
        """The analysis of a study. Each access is recorded."""
        return self._call("GET", f"/api/researcher/studies/{study}/analysis")

    def analysis_zip(self, study: str | int) -> bytes:
        """The same as one ZIP file: tables with their data dictionary, figures, JSON, checksums."""
        return self._call("GET", f"/api/researcher/studies/{study}/analysis.zip", answer="bytes")

    def change_study(self, study: str | int, *, reason: str, passphrase: str | None = None, **fields: Any) -> StudyDetail:
        """Opens, closes, locks or unblinds a study, or records that a surgeon withdrew."""
        return self._call("POST", f"/api/researcher/studies/{study}/changes", body={"passphrase": passphrase, "reason": reason, **fields})

    def study_export(self, study: str | int) -> StudyExportState:
        """The state of the latest export of a study. A finished export is kept for an hour, unless a
        surgeon withdraws or words are erased."""
        return self._call("GET", f"/api/researcher/studies/{study}/export")

    def start_study_export(self, study: str | int, *, unblinded: bool | None = None) -> StudyExportState:
        """Begins to export all sessions of a study as one package, in the background. If an export is
        already being made, no other begins, and the answer gives the progress of that one."""
        return self._call("POST", f"/api/researcher/studies/{study}/export", body={"unblinded": unblinded})

    def study_export_zip(self, study: str | int) -> bytes:
        """The finished export of a study as one ZIP file: the same as `parfocal export --study`
        writes."""
        return self._call("GET", f"/api/researcher/studies/{study}/export.zip", answer="bytes")

class ServiceRequests:
    """Requests of the group "service"."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._call = call

    def chain_head(self) -> ChainHead:
        """The head of the chain. A note of it can later prove that nothing recorded before it was
        changed."""
        return self._call("GET", "/api/chain/head")

    def openapi(self) -> dict[str, Any]:
        """This document."""
        return self._call("GET", "/api/openapi.json")

    def healthz(self) -> Health:
        """The server's health, and what is wrong."""
        return self._call("GET", "/healthz")

    def metrics(self) -> str:
        """The server's counters in the `OpenMetrics` text format."""
        return self._call("GET", "/metrics", answer="text")

class SurgeonRequests:
    """Requests of the group "surgeon"."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._call = call

    def act(self, *, session: SessionId, **fields: Any) -> SurgeonView | None:
        """Advances the session; repeating an action changes nothing. Returns the session after the
        action."""
        return self._call("POST", "/api/surgeon/actions", body={"session": session, **fields})

    def answer(self, *, key: IdempotencyKey, question: str, session: SessionId, value: AnswerValue, client_millis: int | None = None, device: DeviceId | None = None, sequence: int | None = None, waited_by: WaitClock | None = None, waited_millis: int | None = None, segment: SegmentId | None = None) -> None:
        """Stores an answer: once this has answered, it is on disk. If a question has several, the one
        given last counts. One that arrives too long after the session's end is stored, but never
        counts."""
        return self._call("POST", "/api/surgeon/answers", answer="nothing", body={"client_millis": client_millis, "device": device, "sequence": sequence, "waited_by": waited_by, "waited_millis": waited_millis, "key": key, "question": question, "segment": segment, "session": session, "value": value})

    def comment(self, *, key: IdempotencyKey, session: SessionId, picture_width: int | None = None, pictures_per_second: float | None = None, client_millis: int | None = None, device: DeviceId | None = None, sequence: int | None = None, waited_by: WaitClock | None = None, waited_millis: int | None = None, frame: int | None = None, run: int | None = None, segment: SegmentId | None = None, **fields: Any) -> None:
        """Stores a comment: once this has answered, it is on disk. A comment sent again with the same
        key is stored once."""
        return self._call("POST", "/api/surgeon/comments", answer="nothing", body={"picture_width": picture_width, "pictures_per_second": pictures_per_second, "client_millis": client_millis, "device": device, "sequence": sequence, "waited_by": waited_by, "waited_millis": waited_millis, "frame": frame, "key": key, "run": run, "segment": segment, "session": session, **fields})

    def holding(self, *, device: DeviceId, holding: int, session: SessionId) -> None:
        """Notes how much of a session a surgeon's device still holds, so that nobody unblinds it
        without being warned."""
        return self._call("POST", "/api/surgeon/holding", answer="nothing", body={"device": device, "holding": holding, "session": session})

    def patch(self, *, frame: int, at: Touch | None = None, follows: bool | None = None, session: SessionId | None = None) -> None:
        """Points the focus at a place in the picture, or back at the centre. In a session it is
        recorded, and only while a setting is inspected whose protocol lets the surgeon point."""
        return self._call("POST", "/api/surgeon/patch", answer="nothing", body={"at": at, "follows": follows, "frame": frame, "session": session})

    def session(self) -> SurgeonView | None:
        """The session under way; null if there is none."""
        return self._call("GET", "/api/surgeon/session")

    def tried(self, *, device: DeviceId, tried: builtins.list[TriedPart]) -> bytes:
        """Notes what works on a surgeon's tablet, for the operator's page. It is forgotten when the
        server ends."""
        return self._call("POST", "/api/surgeon/tablet-trials", answer="bytes", body={"device": device, "tried": tried})

    def keep_piece(self, comment: str | int, piece: str | int, *, session: SessionId, through_ms: int, content: bytes, media_type: Literal["audio/mp4", "audio/ogg;codecs=opus", "audio/webm;codecs=opus"], ended: Literal["released", "limit", "microphone-lost", "left"] | None = None) -> None:
        """Stores a piece of a recording: once this has answered, it is on disk. The comment (of kind
        voice) must come first; its pieces may then come late, repeatedly, and in any order."""
        return self._call("POST", f"/api/surgeon/voice/{comment}/{piece}", answer="nothing", query={"session": session, "through_ms": through_ms, "ended": ended}, content=content, media_type=media_type)

class TrustRequests:
    """Requests of the group "trust"."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._call = call

    def certificate(self) -> bytes:
        """The authority's certificate, PEM."""
        return self._call("GET", "/trust/authority.crt", answer="bytes")

class Groups:
    """All requests, in the groups of the interface."""

    def _make_groups(self, call: Callable[..., Any]) -> None:
        self.accounts = AccountsRequests(call)
        self.operator = OperatorRequests(call)
        self.researcher = ResearcherRequests(call)
        self.service = ServiceRequests(call)
        self.surgeon = SurgeonRequests(call)
        self.trust = TrustRequests(call)

class AsyncAccountsRequests:
    """Requests of the group "accounts"."""

    def __init__(self, call: Callable[..., Awaitable[Any]]) -> None:
        self._call = call

    def list(self) -> Awaitable[builtins.list[AccountLine]]:
        """All accounts, by name."""
        return self._call("GET", "/api/researcher/accounts")

    def make(self, *, account: str, display: str, first_passphrase: str, passphrase: str, role: AccountRole) -> Awaitable[Account]:
        """Makes an account. Its person chooses another passphrase at the first sign-in."""
        return self._call("POST", "/api/researcher/accounts", body={"account": account, "display": display, "first_passphrase": first_passphrase, "passphrase": passphrase, "role": role})

    def change(self, account: str | int, *, passphrase: str, **fields: Any) -> Awaitable[builtins.list[AccountLine]]:
        """Changes an account."""
        return self._call("POST", f"/api/researcher/accounts/{account}/changes", body={"passphrase": passphrase, **fields})

    def backup_state(self) -> Awaitable[BackupState]:
        """The state of the latest backup that the lead who is signed in asked for. It is kept for 15
        minutes, unless words are erased."""
        return self._call("GET", "/api/researcher/backup")

    def start_backup(self, *, passphrase: str) -> Awaitable[BackupState]:
        """Begins to make a backup in the background, and records that. If one is being made already,
        no other begins."""
        return self._call("POST", "/api/researcher/backup", body={"passphrase": passphrase})

    def backup_file(self) -> Awaitable[bytes]:
        """The backup as a file for `parfocal restore`."""
        return self._call("GET", "/api/researcher/backup.db", answer="bytes")

    def sign_in(self, *, name: str, passphrase: str, as_bearer: bool | None = None, new_passphrase: str | None = None) -> Awaitable[SignedInAs]:
        """Signs in. The answer takes longer after failed attempts."""
        return self._call("POST", "/api/sign-in", body={"as_bearer": as_bearer, "name": name, "new_passphrase": new_passphrase, "passphrase": passphrase})

    def sign_out(self) -> Awaitable[None]:
        """Signs out: the token is no longer valid. Signing out again changes nothing."""
        return self._call("POST", "/api/sign-out", answer="nothing")

class AsyncOperatorRequests:
    """Requests of the group "operator"."""

    def __init__(self, call: Callable[..., Awaitable[Any]]) -> None:
        self._call = call

    def act(self, *, session: SessionId, **fields: Any) -> Awaitable[OperatorView | None]:
        """Advances the session; repeating an action changes nothing. Returns the session after the
        action."""
        return self._call("POST", "/api/operator/actions", body={"session": session, **fields})

    def offer(self) -> Awaitable[CameraOffer]:
        """What can be changed now, with the camera's own bounds. Empty for a camera without such
        settings, or one that is disconnected."""
        return self._call("GET", "/api/operator/camera")

    def change(self, *, setting: Setting, value: float) -> Awaitable[None]:
        """Changes a setting before the next frame."""
        return self._call("POST", "/api/operator/camera", answer="nothing", body={"setting": setting, "value": value})

    def checks(self) -> Awaitable[Checks]:
        """Whether everything is ready for a trial."""
        return self._call("GET", "/api/operator/checks")

    def choices(self) -> Awaitable[Choices]:
        """What the operator can choose from."""
        return self._call("GET", "/api/operator/choices")

    def consent(self, *, given_on: str, medium: Medium, obtained_by: str, text_version: str, session: SessionId) -> Awaitable[OperatorView | None]:
        """Records a participant's consent. Returns the session after that."""
        return self._call("POST", "/api/operator/consents", body={"given_on": given_on, "medium": medium, "obtained_by": obtained_by, "text_version": text_version, "session": session})

    def dismiss(self, *, session: SessionId) -> Awaitable[OperatorView | None]:
        """Takes an ended session off the screens, so that the next can be prepared."""
        return self._call("POST", "/api/operator/dismissals", body={"session": session})

    def focus(self, **fields: Any) -> Awaitable[None]:
        """Puts a policy in charge of the focus, or sets the focal power by hand. While a session is
        under way only the latter, and only while it is paused or after an abort; that is recorded
        in the session."""
        return self._call("POST", "/api/operator/focus", answer="nothing", body={**fields})

    def add_participant(self, *, code: str) -> Awaitable[builtins.list[str]]:
        """Adds a participant; one that exists already stays as it is. Answers with all codes."""
        return self._call("POST", "/api/operator/participants", body={"code": code})

    def patch(self, *, frame: int, at: Touch | None = None, follows: bool | None = None, session: SessionId | None = None) -> Awaitable[None]:
        """Points the focus at a place in the picture, or back at the centre. In a session it is
        recorded, and only while a setting is inspected whose protocol lets the surgeon point."""
        return self._call("POST", "/api/operator/patch", answer="nothing", body={"at": at, "follows": follows, "frame": frame, "session": session})

    def status(self) -> Awaitable[RecordingStatus]:
        """The state of recording, and how long the disk will last."""
        return self._call("GET", "/api/operator/recording")

    def order(self, *, record: bool) -> Awaitable[RecordingStatus]:
        """Starts or stops recording. Stopping again changes nothing. Answers with the new state of
        recording."""
        return self._call("POST", "/api/operator/recording", body={"record": record})

    def session(self) -> Awaitable[OperatorView | None]:
        """The session under way; null if there is none."""
        return self._call("GET", "/api/operator/session")

    def create(self, *, participant: str, protocol: str, study: StudyPlace | None = None) -> Awaitable[OperatorView | None]:
        """Prepares a session: draws its order, or takes the next place of its study's list, and waits
        for its start."""
        return self._call("POST", "/api/operator/sessions", body={"participant": participant, "protocol": protocol, "study": study})

    def spectra(self, *, places: builtins.list[LivePlace]) -> Awaitable[LiveSpectra]:
        """The spectra at places of the camera's next frame. Not while a session is under way."""
        return self._call("POST", "/api/operator/spectra", body={"places": places})

    def link(self) -> Awaitable[SurgeonLink]:
        """The surgeon's link. In a session of a study it is valid only for that session, and ends with
        it."""
        return self._call("GET", "/api/operator/surgeon-link")

class AsyncResearcherRequests:
    """Requests of the group "researcher"."""

    def __init__(self, call: Callable[..., Awaitable[Any]]) -> None:
        self._call = call

    def list(self) -> Awaitable[builtins.list[SessionLine]]:
        """The sessions, newest first, including practice sessions, which are marked."""
        return self._call("GET", "/api/researcher/sessions")

    def session(self, session: str | int) -> Awaitable[SessionDetail]:
        """One session in detail; with its policies once it is unblinded."""
        return self._call("GET", f"/api/researcher/sessions/{session}")

    def correct(self, session: str | int, *, reason: str, **fields: Any) -> Awaitable[None]:
        """Corrects a record of a session that has ended. The original stays; the correction is kept
        beside it."""
        return self._call("POST", f"/api/researcher/sessions/{session}/corrections", answer="nothing", body={"reason": reason, **fields})

    def course(self, session: str | int) -> Awaitable[Timeline]:
        """One session over time, without its focal path."""
        return self._call("GET", f"/api/researcher/sessions/{session}/course")

    def erase(self, session: str | int, *, reason: str, record: str, subject: Erasable) -> Awaitable[None]:
        """Erases words permanently. Once this has answered, they are nowhere in the database. Their
        record and its hash stay."""
        return self._call("POST", f"/api/researcher/sessions/{session}/erasures", answer="nothing", body={"reason": reason, "record": record, "subject": subject})

    def erase_all(self, session: str | int, *, reason: str) -> Awaitable[None]:
        """Erases all words of a withdrawn session permanently: comments with their sound, answers in
        words, and notes. Once this has answered, they are nowhere in the database. Their records
        and hashes stay."""
        return self._call("POST", f"/api/researcher/sessions/{session}/erasures/all", answer="nothing", body={"reason": reason})

    def zip(self, session: str | int, *, unblinded: bool | None = None) -> Awaitable[bytes]:
        """A session's export as one ZIP file: CSV, JSON, a data dictionary, checksums. The same as
        `parfocal export` writes."""
        return self._call("GET", f"/api/researcher/sessions/{session}/export.zip", answer="bytes", query={"unblinded": unblinded})

    def recordings(self, session: str | int) -> Awaitable[SessionRecordings]:
        """The recordings of an unblinded session, with the times of their frames. Each access is
        recorded."""
        return self._call("GET", f"/api/researcher/sessions/{session}/recordings")

    def frame(self, session: str | int, recording: str | int, frame: str | int, *, size: Literal["cell", "half"] | None = None) -> Awaitable[bytes]:
        """A frame of a recording of an unblinded session. Frames count from 0."""
        return self._call("GET", f"/api/researcher/sessions/{session}/recordings/{recording}/frames/{frame}", answer="bytes", query={"size": size})

    def spectrum(self, session: str | int, recording: str | int, frame: str | int, *, x: float, y: float, radius: float | None = None) -> Awaitable[PlaceSpectrum]:
        """The spectrum at a place of a recorded mosaic of an unblinded session. Frames count from 0."""
        return self._call("GET", f"/api/researcher/sessions/{session}/recordings/{recording}/frames/{frame}/spectrum", query={"x": x, "y": y, "radius": radius})

    def timeline(self, session: str | int) -> Awaitable[Timeline]:
        """One session over time with its focal path. The path may tell policies apart, so each access
        is recorded."""
        return self._call("GET", f"/api/researcher/sessions/{session}/timeline")

    def unblind(self, session: str | int, *, reason: str, despite_outstanding: bool | None = None, passphrase: str | None = None) -> Awaitable[None]:
        """Unblinds a session. If it is still under way, or belongs to a study that is still blinded,
        this is emergency unblinding and permanently marked as such."""
        return self._call("POST", f"/api/researcher/sessions/{session}/unblind", answer="nothing", body={"despite_outstanding": despite_outstanding, "passphrase": passphrase, "reason": reason})

    def recording(self, session: str | int, comment: str | int) -> Awaitable[bytes]:
        """The sound of a voice comment, as far as it has arrived, for a player: with its duration,
        which browsers do not write into what they record. Exports have it as it arrived. A request
        for a range of bytes gets that range."""
        return self._call("GET", f"/api/researcher/sessions/{session}/voice/{comment}", answer="bytes")

    def withdraw(self, session: str | int, *, reason: str) -> Awaitable[None]:
        """Records that the participant withdrew: from now on the session's data are not shown,
        analysed or exported."""
        return self._call("POST", f"/api/researcher/sessions/{session}/withdraw", answer="nothing", body={"reason": reason})

    def list_studies(self) -> Awaitable[builtins.list[StudyLine]]:
        """The studies, in the order in which they were planned."""
        return self._call("GET", "/api/researcher/studies")

    def plan_study(self, *, definition: str, reason: str, sites: builtins.list[str] | None = None) -> Awaitable[StudyDetail]:
        """Plans a study."""
        return self._call("POST", "/api/researcher/studies", body={"definition": definition, "reason": reason, "sites": sites})

    def study(self, study: str | int) -> Awaitable[StudyDetail]:
        """One study in detail, without the orders."""
        return self._call("GET", f"/api/researcher/studies/{study}")

    def analysis(self, study: str | int) -> Awaitable[Analysis]:
        """The analysis of a study. Each access is recorded."""
        return self._call("GET", f"/api/researcher/studies/{study}/analysis")

    def analysis_zip(self, study: str | int) -> Awaitable[bytes]:
        """The same as one ZIP file: tables with their data dictionary, figures, JSON, checksums."""
        return self._call("GET", f"/api/researcher/studies/{study}/analysis.zip", answer="bytes")

    def change_study(self, study: str | int, *, reason: str, passphrase: str | None = None, **fields: Any) -> Awaitable[StudyDetail]:
        """Opens, closes, locks or unblinds a study, or records that a surgeon withdrew."""
        return self._call("POST", f"/api/researcher/studies/{study}/changes", body={"passphrase": passphrase, "reason": reason, **fields})

    def study_export(self, study: str | int) -> Awaitable[StudyExportState]:
        """The state of the latest export of a study. A finished export is kept for an hour, unless a
        surgeon withdraws or words are erased."""
        return self._call("GET", f"/api/researcher/studies/{study}/export")

    def start_study_export(self, study: str | int, *, unblinded: bool | None = None) -> Awaitable[StudyExportState]:
        """Begins to export all sessions of a study as one package, in the background. If an export is
        already being made, no other begins, and the answer gives the progress of that one."""
        return self._call("POST", f"/api/researcher/studies/{study}/export", body={"unblinded": unblinded})

    def study_export_zip(self, study: str | int) -> Awaitable[bytes]:
        """The finished export of a study as one ZIP file: the same as `parfocal export --study`
        writes."""
        return self._call("GET", f"/api/researcher/studies/{study}/export.zip", answer="bytes")

class AsyncServiceRequests:
    """Requests of the group "service"."""

    def __init__(self, call: Callable[..., Awaitable[Any]]) -> None:
        self._call = call

    def chain_head(self) -> Awaitable[ChainHead]:
        """The head of the chain. A note of it can later prove that nothing recorded before it was
        changed."""
        return self._call("GET", "/api/chain/head")

    def openapi(self) -> Awaitable[dict[str, Any]]:
        """This document."""
        return self._call("GET", "/api/openapi.json")

    def healthz(self) -> Awaitable[Health]:
        """The server's health, and what is wrong."""
        return self._call("GET", "/healthz")

    def metrics(self) -> Awaitable[str]:
        """The server's counters in the `OpenMetrics` text format."""
        return self._call("GET", "/metrics", answer="text")

class AsyncSurgeonRequests:
    """Requests of the group "surgeon"."""

    def __init__(self, call: Callable[..., Awaitable[Any]]) -> None:
        self._call = call

    def act(self, *, session: SessionId, **fields: Any) -> Awaitable[SurgeonView | None]:
        """Advances the session; repeating an action changes nothing. Returns the session after the
        action."""
        return self._call("POST", "/api/surgeon/actions", body={"session": session, **fields})

    def answer(self, *, key: IdempotencyKey, question: str, session: SessionId, value: AnswerValue, client_millis: int | None = None, device: DeviceId | None = None, sequence: int | None = None, waited_by: WaitClock | None = None, waited_millis: int | None = None, segment: SegmentId | None = None) -> Awaitable[None]:
        """Stores an answer: once this has answered, it is on disk. If a question has several, the one
        given last counts. One that arrives too long after the session's end is stored, but never
        counts."""
        return self._call("POST", "/api/surgeon/answers", answer="nothing", body={"client_millis": client_millis, "device": device, "sequence": sequence, "waited_by": waited_by, "waited_millis": waited_millis, "key": key, "question": question, "segment": segment, "session": session, "value": value})

    def comment(self, *, key: IdempotencyKey, session: SessionId, picture_width: int | None = None, pictures_per_second: float | None = None, client_millis: int | None = None, device: DeviceId | None = None, sequence: int | None = None, waited_by: WaitClock | None = None, waited_millis: int | None = None, frame: int | None = None, run: int | None = None, segment: SegmentId | None = None, **fields: Any) -> Awaitable[None]:
        """Stores a comment: once this has answered, it is on disk. A comment sent again with the same
        key is stored once."""
        return self._call("POST", "/api/surgeon/comments", answer="nothing", body={"picture_width": picture_width, "pictures_per_second": pictures_per_second, "client_millis": client_millis, "device": device, "sequence": sequence, "waited_by": waited_by, "waited_millis": waited_millis, "frame": frame, "key": key, "run": run, "segment": segment, "session": session, **fields})

    def holding(self, *, device: DeviceId, holding: int, session: SessionId) -> Awaitable[None]:
        """Notes how much of a session a surgeon's device still holds, so that nobody unblinds it
        without being warned."""
        return self._call("POST", "/api/surgeon/holding", answer="nothing", body={"device": device, "holding": holding, "session": session})

    def patch(self, *, frame: int, at: Touch | None = None, follows: bool | None = None, session: SessionId | None = None) -> Awaitable[None]:
        """Points the focus at a place in the picture, or back at the centre. In a session it is
        recorded, and only while a setting is inspected whose protocol lets the surgeon point."""
        return self._call("POST", "/api/surgeon/patch", answer="nothing", body={"at": at, "follows": follows, "frame": frame, "session": session})

    def session(self) -> Awaitable[SurgeonView | None]:
        """The session under way; null if there is none."""
        return self._call("GET", "/api/surgeon/session")

    def tried(self, *, device: DeviceId, tried: builtins.list[TriedPart]) -> Awaitable[bytes]:
        """Notes what works on a surgeon's tablet, for the operator's page. It is forgotten when the
        server ends."""
        return self._call("POST", "/api/surgeon/tablet-trials", answer="bytes", body={"device": device, "tried": tried})

    def keep_piece(self, comment: str | int, piece: str | int, *, session: SessionId, through_ms: int, content: bytes, media_type: Literal["audio/mp4", "audio/ogg;codecs=opus", "audio/webm;codecs=opus"], ended: Literal["released", "limit", "microphone-lost", "left"] | None = None) -> Awaitable[None]:
        """Stores a piece of a recording: once this has answered, it is on disk. The comment (of kind
        voice) must come first; its pieces may then come late, repeatedly, and in any order."""
        return self._call("POST", f"/api/surgeon/voice/{comment}/{piece}", answer="nothing", query={"session": session, "through_ms": through_ms, "ended": ended}, content=content, media_type=media_type)

class AsyncTrustRequests:
    """Requests of the group "trust"."""

    def __init__(self, call: Callable[..., Awaitable[Any]]) -> None:
        self._call = call

    def certificate(self) -> Awaitable[bytes]:
        """The authority's certificate, PEM."""
        return self._call("GET", "/trust/authority.crt", answer="bytes")

class AsyncGroups:
    """All requests, in the groups of the interface."""

    def _make_groups(self, call: Callable[..., Awaitable[Any]]) -> None:
        self.accounts = AsyncAccountsRequests(call)
        self.operator = AsyncOperatorRequests(call)
        self.researcher = AsyncResearcherRequests(call)
        self.service = AsyncServiceRequests(call)
        self.surgeon = AsyncSurgeonRequests(call)
        self.trust = AsyncTrustRequests(call)
