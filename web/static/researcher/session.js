// The researcher's page of one session over time. The timeline, the recording and the list of comments move together.

import { get, inWords } from "../shared/api.js";
import { byId, make, setText } from "../shared/dom.js";
import { clockText } from "../shared/text.js";
import { askErasure, askNote, askTranscript } from "./corrections.js";
import { drawMetric } from "./metric_drawing.js";
import { Player } from "./player.js";
import { lastComment, lengthOf, Scale } from "./timeline.js";
import { drawTimeline } from "./timeline_drawing.js";
import { commentWords, seenWords, setAsideWords } from "./timeline_words.js";
import { voicePlayer } from "./voice.js";

const page = byId("session").dataset;
const session = page.session ?? "";
const ended = page.ended === "true";
const unblinded = page.unblinded === "true";
const zone = byId("zone").textContent ?? "";

/** @type {Api.Timeline | null} */
let timeline = null;
/** @type {string[]} */
let policies = [];
let withPath = unblinded;
/** Plays the recording of an unblinded session that has one. @type {Player | null} */
let player = null;
/** Points out a comment on the timeline. @type {(comment: number) => void} */
let pointOut = () => {};
/** Moves the playhead on the timeline. @type {(seconds: number) => void} */
let movePlayhead = () => {};
/** Converts pixels of the timeline into seconds. @type {Scale | null} */
let scale = null;
/** The last comment that playback has passed; -1 before the first. */
let passed = -1;

const NARROWEST_DRAWING = 320;
/** @type {HTMLButtonElement[]} */
let lines = [];
/** @type {number | null} */
let chosen = null;

function withFocalPath() {
  return get("/api/researcher/sessions/{session}/timeline", { session });
}

/**
 * Takes what was loaded, and lists its comments and answers. The drawing and the list tell a comment by its place among
 * all, so both are made of the same timeline: while a session is under way, or a tablet sends late, there are more
 * comments each time. The comment that was pointed out stays so.
 *
 * @param {Api.Timeline} loaded
 */
function take(loaded) {
  const key = chosen === null ? null : timeline?.comments[chosen]?.key;
  const kept = loaded.comments.findIndex((comment) => comment.key === key);
  chosen = kept < 0 ? null : kept;
  timeline = loaded;
  listComments(loaded.comments);
  listSetAside(loaded.set_aside);
  markChosen();
}

async function load() {
  try {
    // The server records that somebody looked at the focal path. So it is loaded only if it is shown.
    const loaded = withPath
      ? await withFocalPath()
      : await get("/api/researcher/sessions/{session}/course", { session });
    if (unblinded) {
      const detail = await get("/api/researcher/sessions/{session}", { session });
      policies = detail.unblinding?.policies ?? [];
    }
    take(loaded);
    if (unblinded) await openPlayer(loaded);
    new ResizeObserver(draw).observe(byId("timeline"));
  } catch (error) {
    setText(byId("timeline-trouble"), inWords(error));
  }
}

/**
 * Opens the player for the session's recordings. If there are none, it leaves the page as it is.
 *
 * @param {Api.Timeline} shown
 */
async function openPlayer(shown) {
  try {
    const { recordings, problems } = await get("/api/researcher/sessions/{session}/recordings", { session });
    const lines = problems.map((problem) => make("p", { className: "notice-line warn" }, problem));
    byId("recording-problems").replaceChildren(...lines);
    if (recordings.length === 0) return;

    player = new Player({
      session,
      timeline: shown,
      policies,
      recordings,
      moved: followPlayhead,
    });
    byId("comment-list").classList.add("beside-player");
    byId("comments-play").hidden = shown.comments.length === 0;
    byId("timeline").addEventListener("click", seek);
  } catch (error) {
    setText(byId("timeline-trouble"), `The recording cannot be played. ${inWords(error)}`);
  }
}

/**
 * Follows the playhead, and points out comments as playback passes them.
 *
 * @param {number} seconds
 * @param {boolean} playing
 */
function followPlayhead(seconds, playing) {
  movePlayhead(seconds);
  const last = lastComment(timeline?.comments ?? [], seconds);
  if (playing && last > passed) choose(last);
  passed = last;
}

/** @param {MouseEvent} event */
function seek(event) {
  const x = event.clientX - byId("timeline").getBoundingClientRect().left;
  if (scale) player?.seek(scale.secondsAt(x));
}

/** @param {Api.TimelineComment[]} comments */
function listComments(comments) {
  // What was taken back at once is listed, but counts no more.
  const standing = comments.filter(({ withdrawn }) => !withdrawn).length;
  setText(byId("comment-count"), comments.length === 0 ? "" : String(standing));
  lines = comments.map((comment, index) => {
    const words = commentWords(comment, zone);
    const isSaid = comment.kind !== "mark" && !(comment.kind === "voice" && !comment.note);
    const kept = comment.withdrawn ? make("del", {}, words) : words;
    const shown = isSaid ? kept : make("em", {}, kept);
    const late = comment.late && make("span", { className: "badge warn" }, "late");
    const back = comment.withdrawn && make("span", { className: "badge" }, "taken back at once");
    const where = comment.setting ? `Setting ${comment.setting}` : "";
    const seen = make(
      "small",
      { title: "What the surgeon saw: width of the picture, pictures a second" },
      seenWords(comment),
    );
    return make(
      "button",
      {
        type: "button",
        onclick: () => jump(index),
        onfocus: (/** @type {FocusEvent} */ event) => reach(event, index),
      },
      make("span", { className: "when" }, clockText(comment.seconds)),
      make("span", { className: "muted where" }, where, seen),
      make("span", { className: "said" }, shown, late && " ", late, back && " ", back),
    );
  });
  const items = lines.map((line, index) => {
    const comment = comments[index];
    return make("li", {}, line, comment ? besideComment(comment) : null);
  });
  byId("comment-list").replaceChildren(...items);
}

/**
 * The sound of a comment, the note on it, and what can be done with the comment once the session has ended.
 *
 * @param {Api.TimelineComment} comment
 */
function besideComment(comment) {
  const { key, kind, note, erased } = comment;
  const isVoice = kind === "voice";
  // The note on a voice comment is its transcript. It is shown in the line itself.
  const noted = note && !isVoice ? make("p", { className: "note" }, `Note: ${note}`) : null;
  const button = (
    /** @type {string} */ label,
    /** @type {string} */ level,
    /** @type {() => void} */ onclick,
  ) => make("button", { type: "button", className: `small ${level}`, onclick }, label);
  const write = () => (isVoice ? askTranscript(session, comment) : askNote(session, key, note ?? ""));
  const deeds = ended ? [button(isVoice ? "Transcribe…" : "Note…", "", write)] : [];
  // A mark has no words, but a note on it can have some. So can a note that was written after the words were erased.
  const hasWords = note || (!erased && kind !== "mark");
  if (ended && hasWords) {
    deeds.push(button("Erase…", "danger", () => askErasure(session, "comment", key)));
  }
  const player = voicePlayer(session, comment);
  return make("div", { className: "beside" }, player, noted, make("span", { className: "deeds" }, ...deeds));
}

/**
 * Lists the answers that do not count, because another device gave a later one or because they arrived too late.
 *
 * @param {Api.SetAside[]} answers
 */
function listSetAside(answers) {
  const items = answers.map((answer) => {
    const when = make("span", { className: "when" }, clockText(answer.seconds));
    const where = answer.setting ? `Setting ${answer.setting}` : "Closing";
    const about = ` ${where}: ${answer.text || answer.question} `;
    const erase = () => askErasure(session, "answer", answer.key);
    // Otherwise it is erased with the answer that counts, in all its versions.
    const isAlone = typeof answer.value === "string" && answer.value !== "" && answer.counted == null;
    const deed =
      ended &&
      isAlone &&
      make("button", { type: "button", className: "small danger", onclick: erase }, "Erase…");
    return make("li", {}, when, about, make("strong", {}, setAsideWords(answer)), deed && " ", deed);
  });
  byId("aside").hidden = items.length === 0;
  byId("aside-list").replaceChildren(...items);
}

function markChosen() {
  for (const [index, line] of lines.entries()) {
    if (index === chosen) line.setAttribute("aria-current", "true");
    else line.removeAttribute("aria-current");
  }
}

/** @param {number} index */
function choose(index) {
  chosen = index;
  pointOut(index);
  markChosen();
  const line = lines[index];
  if (!line) return;
  // If there is a player, the page must not scroll away from its picture.
  if (player) scrollWithin(byId("comment-list"), line);
  else line.scrollIntoView({ block: "nearest" });
}

/**
 * Points out a comment that was reached with the keyboard. A tap points out its comment only when it ends, because
 * scrolling earlier would move the comment away from under the finger.
 *
 * @param {FocusEvent} event
 * @param {number} index
 */
function reach({ currentTarget }, index) {
  if (currentTarget instanceof Element && currentTarget.matches(":focus-visible")) choose(index);
}

/**
 * Scrolls `list` so that `line` is visible, and scrolls nothing else.
 *
 * @param {HTMLElement} list
 * @param {HTMLElement} line
 */
function scrollWithin(list, line) {
  const outer = list.getBoundingClientRect();
  const inner = line.getBoundingClientRect();
  if (inner.top < outer.top) list.scrollTop -= outer.top - inner.top;
  else if (inner.bottom > outer.bottom) list.scrollTop += inner.bottom - outer.bottom;
}

/**
 * Points out a comment, and plays the recording from a little before it.
 *
 * @param {number} index
 */
function jump(index) {
  choose(index);
  const comments = timeline?.comments ?? [];
  const comment = comments[index];
  if (!comment) return;
  // Keeps playback, which begins earlier, from pointing out an earlier comment instead.
  passed = comments.length;
  player?.playBefore(comment.seconds);
}

function draw() {
  if (!timeline) return;
  showKey(timeline);

  const figure = byId("timeline");
  const recorded = player?.spans ?? [];
  scale = new Scale(lengthOf(timeline, recorded), Math.max(figure.clientWidth, NARROWEST_DRAWING));
  const drawn = drawTimeline(figure, timeline, { scale, withPath, policies, recorded, zone, choose, jump });
  pointOut = drawn.pointOut;

  const showsMetric = hasMetric(timeline);
  byId("metric").hidden = !showsMetric;
  const moveOnMetric = showsMetric ? drawMetric(byId("metric"), timeline, scale) : () => {};
  movePlayhead = (seconds) => {
    drawn.movePlayhead(seconds);
    moveOnMetric(seconds);
  };

  if (player) movePlayhead(player.seconds);
  if (chosen !== null) pointOut(chosen);
}

/**
 * Whether to draw the metric: only if there is a player, and if a policy had a metric.
 *
 * @param {Api.Timeline} shown
 */
function hasMetric({ points }) {
  return player !== null && points.some(({ metric }) => metric != null);
}

/** @param {Api.Timeline} shown */
function showKey(shown) {
  const { points, pauses, absences, sights, choices, holds } = shown;
  byId("key-path").hidden = !withPath;
  byId("key-optimum").hidden = !(withPath && points.some(({ optimal }) => optimal != null));
  byId("key-pause").hidden = pauses.length === 0;
  byId("key-absence").hidden = absences.length === 0;
  byId("key-sight").hidden = sights.length === 0;
  byId("key-choice").hidden = choices.length === 0;
  byId("key-hold").hidden = holds.length === 0;
  byId("key-metric").hidden = !hasMetric(shown);
  byId("key-recorded").hidden = player === null;
}

byId("show-path").onclick = async () => {
  try {
    const loaded = await withFocalPath();
    setText(byId("timeline-trouble"), "");
    withPath = true;
    byId("show-path").hidden = true;
    take(loaded);
    draw();
  } catch (error) {
    setText(byId("timeline-trouble"), inWords(error));
  }
};

load();
