// One session as the researcher sees it: the timeline and the list of comments move together; unblinding asks for a reason.

import { get, inWords, post } from "./api.js";
import { askReason } from "./dialogs.js";
import { byId, clockText, make, setText } from "./dom.js";
import { drawTimeline } from "./timeline.js";

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
    new ResizeObserver(draw).observe(byId("timeline"));
  } catch (error) {
    setText(byId("timeline-trouble"), inWords(error));
  }
}

function listComments() {
  lines = timeline.comments.map((comment, index) => {
    const said = comment.kind === "mark" ? make("em", {}, "Marked this moment") : comment.text;
    const where = comment.setting ? `Setting ${comment.setting}` : "";
    return make("button", { type: "button", onclick: () => choose(index), onfocus: () => choose(index) },
      make("span", { className: "when" }, clockText(comment.seconds)), make("span", { className: "muted" }, where), make("span", { className: "said" }, said));
  });
  byId("comment-list").replaceChildren(...lines.map((line) => make("li", {}, line)));
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

function unblind() {
  askReason({
    heading: ended === "true" ? "Unblind this session" : "Emergency unblinding",
    consequence: ended === "true"
      ? "You and everyone with this page will see which policy ran in which setting. This cannot be undone, and stands in the audit trail and in every export."
      : "The session is still under way. Unblinding now is an emergency measure: it is marked as such for good, in the audit trail and in every export. The surgeon’s and operator’s pages still do not show the policies.",
    go: ended === "true" ? "Unblind" : "Unblind now",
    danger: true,
    done: async (reason) => {
      await post(`${API}/unblind`, { reason });
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
