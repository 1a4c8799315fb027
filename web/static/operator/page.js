// The operator's page: the devices and the session from preparing it to its end.

import { get, heardAgain, post, Refused, tellTrouble } from "../shared/api.js";
import { drawCamera } from "./camera_card.js";
import { askIn, askReason, askWhetherMeant } from "../shared/dialogs.js";
import { byId, clockText, make, redraw, setText } from "../shared/dom.js";
import { drawDevices, drawDeviceWords, drawWarnings } from "./devices.js";
import { BY_HAND, drawFocus, UNTOLD } from "./focus.js";
import { unlessOvertaken } from "../shared/live.js";
import { mountViewer } from "../shared/viewer.js";

const viewer = mountViewer(byId("view"), { role: "operator", traces: byId("traces") });
const followAnswer = unlessOvertaken(viewer.live, followSession);
let session = null;
let choices = null;
let endsAt = null;

/* Devices */

let status = null;

function followStatus(next) {
  status = next;
  drawDevices(byId("devices"), status);
  drawDeviceWords(byId("device-words"), status);
  drawWarnings(byId("warnings"), status);
  drawCamera(status.camera_offer);
  drawFocus(status, session !== null);
}

/* The session */

const over = (view) => view.phase === "completed" || view.phase === "aborted";

const PHASES = {
  ready: () => "Ready to start",
  notice: (view) => `Setting ${view.setting} of ${view.settings}: waiting for the surgeon’s tap`,
  inspecting: (view) => `Setting ${view.setting} of ${view.settings}: inspecting`,
  questions: (view) => `Setting ${view.setting} of ${view.settings}: questions`,
  closing: () => "Closing questions",
  completed: () => "Completed",
  aborted: () => "Aborted",
};

function followSession(next) {
  if (session && !next) refresh();
  session = next;
  endsAt = next?.remaining_seconds == null ? null : performance.now() + next.remaining_seconds * 1000;
  byId("new-session").hidden = session !== null;
  byId("running").hidden = session === null;
  byId("follow").hidden = session === null;
  if (status) drawFocus(status, session !== null);
  drawBadges();
  if (!session) return;
  setText(byId("phase"), PHASES[session.phase](session));
  drawUnrecorded();
  byId("steps").replaceChildren(...Array.from({ length: session.settings }, (_, index) => make("li", { className: stepClass(index + 1) })));
  drawActions();
  drawFeed();
  drawTime();
}

function stepClass(number) {
  if (number < session.setting || session.phase === "completed" || session.phase === "closing") return "done";
  return number === session.setting ? "now" : "";
}

function drawBadges() {
  const badges = session
    ? [make("span", { className: "badge" }, session.participant), session.practice && make("span", { className: "badge warn" }, "Practice"), session.paused && make("span", { className: "badge warn" }, "Paused")]
    : [];
  redraw(byId("session-badges"), badges.filter(Boolean));
}

/** Says that the lens was stopped before that could be written down, and what comes of it. */
function drawUnrecorded() {
  const { unrecorded, unrecorded_because: because } = session;
  byId("unrecorded").hidden = !unrecorded;
  if (!unrecorded) return setText(byId("unrecorded"), "");
  const why = because ?? "the disk has not answered";
  const then = "The server goes on trying. If it ends before it can, the session is paused when it starts again.";
  setText(byId("unrecorded"), `The lens is held, but this is not recorded yet: ${why}. ${then}`);
}

function drawTime() {
  const inspecting = session?.phase === "inspecting" && endsAt !== null;
  setText(byId("remaining"), !inspecting ? "" : session.paused ? "clock stopped" : `${clockText((endsAt - performance.now()) / 1000, Math.ceil)} left`);
}

function drawActions() {
  const { phase, paused, setting } = session;
  const buttons = [];
  const add = (label, onclick, className = "") => buttons.push(make("button", { type: "button", className, onclick }, label));
  if (phase === "ready") add("Start", () => act("start"), "primary");
  if (paused) add("Resume", () => act("resume"), "primary");
  else if (phase === "inspecting") add(`End setting ${setting} now…`, endSetting);
  if (!paused && phase !== "ready" && !over(session)) add("Pause…", pause);
  if (over(session)) add("Close and prepare the next", dismiss, "primary");
  else add("Abort…", abort, "danger");
  redraw(byId("session-actions"), buttons);
}

function endSetting() {
  const { session: shown, segment, setting } = session;
  askWhetherMeant({
    heading: `End setting ${setting} now`,
    consequence: "The surgeon’s time with this setting ends for good; the questions about it follow. Comments on it are still kept.",
    go: `End setting ${setting}`,
    done: () => send(shown, { action: "finish-segment", segment }),
  });
}

function pause() {
  const { session: shown } = session;
  askReason({
    heading: "Pause the session",
    consequence: "The clock stops and the lens holds still. The surgeon sees that the session is paused and can still comment.",
    go: "Pause",
    done: (reason) => send(shown, { action: "pause", reason }),
  });
}

function abort() {
  const { session: shown } = session;
  askReason({
    heading: "Abort the session",
    consequence: "The session ends for good and cannot be taken up again. Everything said and answered so far is kept.",
    go: "Abort session",
    danger: true,
    done: (reason) => send(shown, { action: "abort", reason }),
  });
}

async function dismiss() {
  try {
    await followAnswer(post("/api/operator/dismissals", { session: session.session }));
  } catch (error) {
    tellTrouble(byId("session-trouble"), error);
  }
}

/** Does `action` on the session that was shown when it was asked for: another operator may have closed that one. */
async function send(shown, action) {
  if (session?.session !== shown) throw new Refused(409, "This session was closed meanwhile: nothing was done.", true);
  await followAnswer(post("/api/operator/actions", { session: shown, ...action }));
}

async function act(action) {
  try {
    await send(session?.session, { action });
    setText(byId("session-trouble"), "");
  } catch (error) {
    tellTrouble(byId("session-trouble"), error);
  }
}

/* Comments and events, newest first */

const time = (at) => make("time", { dateTime: at, title: at }, new Date(at).toLocaleTimeString([], { hour12: false }));
const SAID = { text: (said) => said.text, quick: (said) => `${said.text} (quick)`, mark: () => "Marked this moment" };

function drawFeed() {
  setText(byId("comment-count"), String(session.comments));
  const comments = session.latest_comments.map((comment) => make("li", {}, time(comment.at), make("span", {}, comment.setting ? make("span", { className: "who" }, `setting ${comment.setting} · `) : null, SAID[comment.kind](comment))));
  const events = session.log.map((line) => make("li", {}, time(line.at), make("span", {}, line.text, make("span", { className: "who" }, ` · ${line.by}`))));
  redraw(byId("comments"), comments.length ? comments : [make("li", { className: "empty" }, "None yet.")]);
  redraw(byId("log"), events);
}

/* Preparing a session */

function fill(select, options, chosen) {
  select.replaceChildren(...options.map(({ value, label, disabled = false, hidden = false }) => make("option", { value, disabled, hidden, selected: value === chosen }, label)));
}

function drawChoices(participant = byId("participant").value) {
  fill(byId("participant"), choices.participants.map((code) => ({ value: code, label: code })), participant);
  fill(byId("protocol"), choices.protocols.map(({ name, researcher_title: label }) => ({ value: name, label })), byId("protocol").value);
  const policies = choices.policies.map(({ name, available }) => ({ value: name, label: available ? name : `${name} (no weights)`, disabled: !available }));
  fill(byId("policy"), [{ value: UNTOLD, label: "Not told during a session", hidden: true }, { value: BY_HAND, label: "By hand" }, ...policies], byId("policy").value);
  if (status) drawFocus(status, session !== null);
  drawSummary();
}

function drawSummary() {
  const protocol = choices.protocols.find(({ name }) => name === byId("protocol").value);
  // With its title: the list cuts long ones off.
  const length = protocol && `${protocol.researcher_title}: ${protocol.settings} settings of at most ${clockText(protocol.segment_seconds)}`;
  setText(byId("protocol-summary"), protocol ? `${length}${protocol.practice ? "; practice, kept apart from real data" : ""}.` : "");
}

byId("protocol").addEventListener("change", drawSummary);
byId("new-session").addEventListener("submit", async (event) => {
  event.preventDefault();
  try {
    await followAnswer(post("/api/operator/sessions", { participant: byId("participant").value, protocol: byId("protocol").value }));
    setText(byId("session-trouble"), "");
  } catch (error) {
    tellTrouble(byId("session-trouble"), error);
  }
});
// Another operator may have added participants.
for (const way of ["pointerenter", "focus"]) byId("participant").addEventListener(way, refresh);
byId("add-participant").onclick = () =>
  askIn(byId("participant-dialog"), byId("participant-trouble"), async () => {
    const code = byId("code").value.trim();
    choices.participants = await post("/api/operator/participants", { code });
    drawChoices(code);
  });

/* Wiring */

byId("copy-link").onclick = async () => {
  const link = byId("surgeon-link");
  link.select();
  try {
    await navigator.clipboard.writeText(link.value);
  } catch {
    document.execCommand("copy"); // the clipboard interface is missing on plain http
  }
  setText(byId("copy-link"), "Copied");
  setTimeout(() => setText(byId("copy-link"), "Copy link"), 2000);
};
for (const box of document.querySelectorAll("[data-overlay]")) {
  const apply = () => viewer.overlay(box.dataset.overlay, box.checked);
  box.addEventListener("change", apply);
  apply();
}

/** Frames without a belief after which the policy has none; the frames of a held lens have none either. */
const BELIEF_FRAMES = 25;
let unbelieved = BELIEF_FRAMES;
viewer.addEventListener("frame", ({ detail }) => {
  unbelieved = detail.belief ? 0 : unbelieved + 1;
  byId("belief-choice").hidden = unbelieved >= BELIEF_FRAMES;
});

async function refresh() {
  const before = choices;
  try {
    const now = await get("/api/operator/choices");
    // A list that is open is drawn anew only for news, and never for what was so before a participant was added here.
    if (choices !== before || JSON.stringify(now) === JSON.stringify(choices)) return;
    choices = now;
    drawChoices();
  } catch (error) {
    tellTrouble(byId("session-trouble"), error);
  }
}

viewer.live.addEventListener("session", (event) => followSession(event.detail));
viewer.live.addEventListener("status", (event) => followStatus(event.detail));
viewer.live.addEventListener("connection", ({ detail: { open } }) => {
  if (!open) return;
  heardAgain();
  refresh();
});
setInterval(drawTime, 250);
refresh();
