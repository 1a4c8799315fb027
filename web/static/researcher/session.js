// One session as the researcher sees it: the timeline and the list of comments move together;
// unblinding asks for a reason.

import { get, inWords, post } from "../shared/api.js";
import { askReason } from "../shared/dialogs.js";
import { byId, make, setText } from "../shared/dom.js";
import { clockText } from "../shared/text.js";
import { drawTimeline } from "./timeline_drawing.js";
import { commentWords, outstandingWords, setAsideWords } from "./timeline_words.js";

const page = byId("session").dataset;
const session = page.session ?? "";
const ended = page.ended === "true";
const unblinded = page.unblinded === "true";

/** @type {Api.Timeline | null} */
let timeline = null;
/** @type {string[]} */
let policies = [];
let withPath = unblinded;
/** Points out a comment on the timeline. @type {(comment: number) => void} */
let pointOut = () => {};
/** @type {HTMLButtonElement[]} */
let lines = [];
/** @type {number | null} */
let chosen = null;

function withFocalPath() {
  return get("/api/researcher/sessions/{session}/timeline", { session });
}

async function load() {
  try {
    // That the focal path is looked at is recorded, so only where it is shown.
    timeline = withPath
      ? await withFocalPath()
      : await get("/api/researcher/sessions/{session}/course", { session });
    if (unblinded) {
      const detail = await get("/api/researcher/sessions/{session}", { session });
      policies = detail.unblinding?.policies ?? [];
    }
    listComments(timeline.comments);
    listSetAside(timeline.set_aside);
    new ResizeObserver(draw).observe(byId("timeline"));
  } catch (error) {
    setText(byId("timeline-trouble"), inWords(error));
  }
}

/** @param {Api.TimelineComment[]} comments */
function listComments(comments) {
  lines = comments.map((comment, index) => {
    const words = commentWords(comment);
    const said = comment.kind === "mark" ? make("em", {}, words) : words;
    const late = comment.late && make("span", { className: "badge warn" }, "late");
    const where = comment.setting ? `Setting ${comment.setting}` : "";
    return make(
      "button",
      { type: "button", onclick: () => choose(index), onfocus: () => choose(index) },
      make("span", { className: "when" }, clockText(comment.seconds)),
      make("span", { className: "muted" }, where),
      make("span", { className: "said" }, said, late && " ", late),
    );
  });
  byId("comment-list").replaceChildren(...lines.map((line) => make("li", {}, line)));
}

/**
 * Answers that do not count: given on another device than a later one, or too late.
 *
 * @param {Api.SetAside[]} answers
 */
function listSetAside(answers) {
  const items = answers.map((answer) => {
    const when = make("span", { className: "when" }, clockText(answer.seconds));
    const where = answer.setting ? `Setting ${answer.setting}` : "Closing";
    const about = ` ${where}: ${answer.text || answer.question} `;
    return make("li", {}, when, about, make("strong", {}, setAsideWords(answer)));
  });
  byId("aside").hidden = items.length === 0;
  byId("aside-list").replaceChildren(...items);
}

/** @param {number} index */
function choose(index) {
  chosen = index;
  pointOut(index);
  for (const [other, line] of lines.entries()) {
    if (other === index) line.setAttribute("aria-current", "true");
    else line.removeAttribute("aria-current");
  }
  lines[index]?.scrollIntoView({ block: "nearest" });
}

function draw() {
  if (!timeline) return;
  showKey(timeline);
  pointOut = drawTimeline(byId("timeline"), timeline, { withPath, policies, choose });
  if (chosen !== null) pointOut(chosen);
}

/** @param {Api.Timeline} shown */
function showKey({ points, pauses }) {
  byId("key-path").hidden = !withPath;
  byId("key-optimum").hidden = !(withPath && points.some(({ optimal }) => optimal != null));
  byId("key-pause").hidden = pauses.length === 0;
}

/** @param {string} moment */
function timeOfDay(moment) {
  return new Date(moment).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
}

/** What a surgeon's tablet may still hold, in words; null where nothing may be outstanding. */
async function outstandingNow() {
  try {
    const { outstanding } = await get("/api/researcher/sessions/{session}", { session });
    return outstandingWords(outstanding, timeOfDay);
  } catch {
    // Where the server does not answer now, it will ask when it is told to unblind.
    return null;
  }
}

async function unblind() {
  const open = await outstandingNow();
  const late = open
    ? ` ${open} What arrives after unblinding is kept and marked late, but does not count.`
    : "";
  const usual =
    "You and everyone with this page will see which policy ran in which setting. This cannot be undone. " +
    `The audit trail and every export will say so.${late}`;
  const emergency =
    "The session is still under way. Unblinding now is an emergency measure. The audit trail and every " +
    "export will always say so. The surgeon’s and operator’s pages still do not show the policies.";

  askReason({
    heading: ended ? "Unblind this session" : "Emergency unblinding",
    consequence: ended ? usual : emergency,
    confirm: open ? "Unblind anyway" : undefined,
    go: ended ? "Unblind" : "Unblind now",
    danger: true,
    done: async (reason) => {
      const path = "/api/researcher/sessions/{session}/unblind";
      await post(path, { reason, despite_outstanding: open !== null }, { session });
      location.reload();
    },
  });
}

byId("show-path").onclick = async () => {
  try {
    timeline = await withFocalPath();
    withPath = true;
    byId("show-path").hidden = true;
    draw();
  } catch (error) {
    setText(byId("timeline-trouble"), inWords(error));
  }
};

// A session that is unblinded already has no such button.
document.getElementById("unblind")?.addEventListener("click", unblind);
load();
