// Types that the pages use by name. What HTTP says comes from `api.d.ts`, which is generated from the server's
// own description. The messages of the WebSocket are not described there: they follow `server/dashboard/src/http/live/`.

import type { components, paths } from "./api.js";

type Json = "application/json";

declare global {
  /** The texts of the languages that were loaded, by their codes: the server's `languages/*.js` put them there. */
  var parfocalLanguages: Record<string, string> | undefined;

  /** What the server says over HTTP. */
  namespace Api {
    type Schemas = components["schemas"];

    type AccountAction = Schemas["AccountAction"];
    type AccountRole = Schemas["AccountRole"];
    type Action = Schemas["Action"];
    type Adjustable = Schemas["Adjustable"];
    type AnswerValue = Schemas["AnswerValue"];
    type CameraOffer = Schemas["CameraOffer"];
    type CommentLine = Schemas["CommentLine"];
    type Focus = Schemas["Focus"];
    type OperatorView = Schemas["OperatorView"];
    type Origin = Schemas["Origin"];
    type NewConsent = Schemas["NewConsent"];
    type NewCorrection = Schemas["NewCorrection"];
    type NewErasure = Schemas["NewErasure"];
    type Outstanding = Schemas["Outstanding"];
    type BandLevel = Schemas["BandLevel"];
    type Pair = Schemas["Pair"];
    type PlaceSpectrum = Schemas["PlaceSpectrum"];
    type Question = Schemas["Question"];
    type RecordingCourse = Schemas["RecordingCourse"];
    type RecordingStatus = Schemas["RecordingStatus"];
    type Scale = Schemas["Scale"];
    type SessionDetail = Schemas["SessionDetail"];
    type SetAside = Schemas["SetAside"];
    type Setting = Schemas["Setting"];
    type StudyAction = Schemas["StudyAction"];
    type StudyExportProgress = Schemas["StudyExportProgress"];
    type StudyExportState = Schemas["StudyExportState"];
    type BackupState = Schemas["BackupState"];
    type SurgeonView = Schemas["SurgeonView"];
    type Timeline = Schemas["Timeline"];
    type TimelineComment = Schemas["TimelineComment"];
    type TimelinePoint = Schemas["TimelinePoint"];

    /** The description leaves a policy's members open. */
    type Choices = Omit<Schemas["Choices"], "policies"> & {
      policies: { name: string; available: boolean }[];
    };

    type GetPath = {
      [Path in keyof paths]: paths[Path] extends {
        get: { responses: { 200: { content: { [type in Json]: unknown } } } };
      }
        ? Path
        : never;
    }[keyof paths];
    type PostPath = {
      [Path in keyof paths]: paths[Path] extends {
        post: { requestBody: { content: { [type in Json]: unknown } } };
      }
        ? Path
        : never;
    }[keyof paths];

    type Got<Path extends GetPath> = Path extends "/api/operator/choices"
      ? Choices
      : paths[Path] extends { get: { responses: { 200: { content: { [type in Json]: infer Body } } } } }
        ? Body
        : never;
    type Sent<Path extends PostPath> = paths[Path] extends {
      post: { requestBody: { content: { [type in Json]: infer Body } } };
    }
      ? Body
      : never;
    type Answered<Path extends PostPath> = paths[Path] extends {
      post: { responses: { 200: { content: { [type in Json]: infer Body } } } };
    }
      ? Body
      : null;
  }

  /** What the server says over the WebSocket. */
  namespace Stream {
    interface Circle {
      x: number;
      y: number;
      radius: number;
    }

    interface Patch {
      x: number;
      y: number;
      width: number;
      height: number;
    }

    /** What goes with each picture; the operator's page gets the last four, null while a session is under way. */
    interface Header {
      frame: number;
      run: number;
      age: number;
      /** Milliseconds that the latest pictures took from the server to this page. */
      travel: number;
      width: number;
      height: number;
      /** Pixels of the picture along each side of a mosaic cell; patch and area are in cells. */
      per_cell: number;
      /** Whether the link is too slow for the size of pictures that the screen can show. */
      reduced: boolean;
      estimated: boolean;
      patch: Patch;
      area: Circle | null;
      /** Whether the focus was pointed somewhere, so that the patch is not at the centre. */
      pointed: boolean;
      /** How often somebody has pointed since the server started. */
      choices: number;
      asked?: number | null;
      measured?: number | null;
      metric?: number | null;
      belief?: number[] | null;
      /** Which places of the picture are in focus; for an operator who asks for it. */
      depths?: { places: PlaceDepth[] } | null;
    }

    interface PlaceDepth {
      /** In mosaic cells. */
      x: number;
      y: number;
      /** Where its optimum is, seen from the lens. */
      side: "in-focus" | "higher" | "lower" | "unknown";
    }

    interface Frame {
      header: Header;
      bitmap: ImageBitmap;
      receivedAt: number;
    }

    interface SurgeonStatus {
      camera_simulated: boolean;
      lens_simulated: boolean;
      notice: string | null;
      certificate_until: string | null;
    }

    interface TabletSign {
      presence: "never-seen" | "present" | "hidden" | "silent";
      away_seconds: number | null;
      slow: boolean;
      size: { width: number; height: number } | null;
    }

    interface OperatorStatus {
      tablet: TabletSign;
      camera: {
        name: string;
        working: boolean;
        simulated: boolean;
        fps: number;
        lost: number;
        message: string;
      };
      camera_offer: Api.CameraOffer | null;
      lens: { name: string; working: boolean; simulated: boolean; caution: boolean; message: string };
      policy: string | null;
      focal_power: number | null;
      held: string | null;
      message: string | null;
      steps_per_second: number;
      steps: number;
      telemetry_dropped: number;
      latency_p50_micros: number | null;
      latency_p99_micros: number | null;
      priority: { standing: string; message: string };
      /** Null while a session is under way, as is whether the patch follows the tissue. */
      lock: "held" | "searching" | "nothing" | null;
      following: "screen" | "tissue" | "lost" | "left" | null;
      certificate_until: string | null;
    }
  }
}
