// One session as the researcher sees it: the timeline and the list of comments move together; unblinding asks for a reason.

import { get, inWords, post } from "../shared/api.js";
import { askReason } from "../shared/dialogs.js";
import { byId, clockText, make, setText } from "../shared/dom.js";
import { drawTimeline, whyAside } from "./timeline.js";

const { session, ended, unblinded } = byId("session").dataset;
const API = `/api/researcher/sessions/${session}`;
let timeline = null;
let policies = [];
let withPath = unblinded === "true";
let point = () => {};
let lines = [];
let chosen = null;

async function load() {
  try {
    timeline = await get(`${API}/timeline`);
    if (unblinded === "true") policies = (await get(API)).unblinding.policies;
    listComments();
    listSetAside();
    new ResizeObserver(draw).observe(byId("timeline"));
  } catch (error) {
    setText(byId("timeline-trouble"), inWords(error));
  }
}

function listComments() {
  lines = timeline.comments.map((comment, index) => {
    const said = comment.kind === "mark" ? make("em", {}, "Marked this moment") : comment.text;
    const late = comment.late && make("span", { className: "badge warn" }, "late");
    const where = comment.setting ? `Setting ${comment.setting}` : "";
    return make("button", { type: "button", onclick: () => choose(index), onfocus: () => choose(index) },
      make("span", { className: "when" }, clockText(comment.seconds)), make("span", { className: "muted" }, where), make("span", { className: "said" }, said, late && " ", late));
  });
  byId("comment-list").replaceChildren(...lines.map((line) => make("li", {}, line)));
}

/** Answers that do not count: given on another device than a later one, or too late. */
function listSetAside() {
  const lines = timeline.set_aside.map((answer) => {
    const where = answer.setting ? `Setting ${answer.setting}` : "Closing";
    const when = make("span", { className: "when" }, clockText(answer.seconds));
    return make("li", {}, when, ` ${where}: ${answer.text || answer.question} `, make("strong", {}, whyAside(answer)));
  });
  byId("aside").hidden = lines.length === 0;
  byId("aside-list").replaceChildren(...lines);
}

function choose(index) {
  chosen = index;
  point(index);
  lines.forEach((line, other) => (other === index ? line.setAttribute("aria-current", "true") : line.removeAttribute("aria-current")));
  lines[index].scrollIntoView({ block: "nearest" });
}

function draw() {
  showKey();
  point = drawTimeline(byId("timeline"), timeline, { withPath, policies, choose });
  if (chosen !== null) point(chosen);
}

function showKey() {
  const shown = { path: withPath, optimum: withPath && timeline.points.some(({ optimal }) => optimal !== null), pause: timeline.pauses.length > 0 };
  for (const entry of byId("timeline-key").children) entry.hidden = !shown[entry.className];
}

/** What a surgeon's tablet may still hold, in words; null where nothing may be outstanding. */
function stillToCome(outstanding) {
  if (!outstanding) return null;
  const { counts_until: until, devices } = outstanding;
  const said = [];
  if (until) {
    const time = new Date(until).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
    said.push(`What a tablet still holds counts until ${time}.`);
  }
  if (devices > 0) {
    const tablets = devices === 1 ? "One tablet has" : `${devices} tablets have`;
    said.push(`${tablets} not said since the end that nothing is left on it.`);
  }
  return said.join(" ");
}

async function unblind() {
  // Where the server does not answer, it will ask when it is told to unblind.
  const { outstanding } = await get(API).catch(() => ({ outstanding: null }));
  const open = stillToCome(outstanding);
  const late = open ? ` ${open} What arrives after unblinding is kept, but marked late, and never counts.` : "";
  askReason({
    heading: ended === "true" ? "Unblind this session" : "Emergency unblinding",
    confirm: open ? "Unblind all the same" : undefined,
    consequence: ended === "true"
      ? `You and everyone with this page will see which policy ran in which setting. This cannot be undone, and stands in the audit trail and in every export.${late}`
      : "The session is still under way. Unblinding now is an emergency measure: it is marked as such for good, in the audit trail and in every export. The surgeon’s and operator’s pages still do not show the policies.",
    go: ended === "true" ? "Unblind" : "Unblind now",
    danger: true,
    done: async (reason) => {
      await post(`${API}/unblind`, { reason, despite_outstanding: open !== null });
      location.reload();
    },
  });
}

byId("show-path").onclick = () => {
  withPath = true;
  byId("show-path").hidden = true;
  if (timeline) draw();
};
if (byId("unblind")) byId("unblind").onclick = unblind;
load();
