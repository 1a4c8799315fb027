//! The outbox of the surgeon's page, which keeps entries until they are saved, in a real browser. Each test decides how
//! the server answers.

use serde_json::{Value, json};

use super::driver::{Browser, Driver};
use super::theatre;

/// A fresh outbox as `outbox`. `answers` are given in turn; `posted` collects what was posted.
const OUTBOX: &str = r#"
    localStorage.clear();
    const page = document.querySelector('script[src$="surgeon/page.js"]').src;
    const { openOutbox } = await import(page.replace("page.js", "device.js"));
    const { diskStoreOn } = await import(page.replace("page.js", "disk_store.js"));
    const spare = diskStoreOn(() => indexedDB, "parfocal.outbox");
    for (const { id } of await spare.all()) await spare.remove(id);
    const posted = [];
    const bodies = [];
    const answers = [];
    const arrivals = [];
    window.fetch = (path, { body }) => {
        bodies.push(JSON.parse(body));
        posted.push(bodies.at(-1).value);
        arrivals.shift()?.();
        return answers.shift() ?? Promise.resolve(new Response(null, { status: 204 }));
    };
    const json = { "content-type": "application/json" };
    const ours = (status) => new Response('{"error": "so it is"}', { status, headers: json });
    const saved = (outbox) => new Promise((done) => outbox.subscribe(() => outbox.waiting.length === 0 && done()));
    const kept = () => Object.keys(localStorage).filter((key) => key.startsWith("parfocal.outbox.")).length;
"#;

async fn run(page: &Browser, script: &str) -> Value {
    page.run(&format!("return (async () => {{ {OUTBOX} {script} }})()"), &[]).await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_last_answer_counts_and_nothing_refused_is_thrown_away() {
    let driver = Driver::start();
    let server = theatre::server();
    let page = driver.browser().await;
    page.open(&server.link("surgeon")).await;

    // An answer is changed while its first value is on its way to a server whose disk is full.
    let script = r#"
        const outbox = openOutbox();
        let fail;
        answers.push(new Promise((done) => (fail = () => done(ours(507)))));
        const arrived = new Promise((done) => arrivals.push(done));
        outbox.add("/answers", { value: 3 }, "sharpness");
        await arrived;
        outbox.add("/answers", { value: 5 }, "sharpness");
        const done = saved(outbox);
        fail();
        await done;
        const first = bodies[0].sequence;
        const devices = new Set(bodies.map(({ device }) => device));
        return [posted, kept(), bodies.map(({ sequence }) => sequence - first), devices.size];
    "#;
    assert_eq!(
        run(&page, script).await,
        json!([[3, 5, 3], 0, [0, 1, 0], 1]),
        "nothing is dropped, and each says as which of all it was given, so that the server knows the last"
    );

    // The same, with the tablet's clock set back between the two.
    let script = r#"
        const outbox = openOutbox();
        const clock = Date.now;
        let fail;
        answers.push(new Promise((done) => (fail = () => done(ours(507)))));
        const arrived = new Promise((done) => arrivals.push(done));
        outbox.add("/answers", { value: 3 }, "sharpness");
        await arrived;
        Date.now = () => clock() - 60000;
        outbox.add("/answers", { value: 5 }, "sharpness");
        const done = saved(outbox);
        fail();
        await done;
        Date.now = clock;
        return [posted, kept(), bodies[1].sequence - bodies[0].sequence];
    "#;
    assert_eq!(run(&page, script).await, json!([[3, 5, 3], 0, 1]), "what was said last is known as the last");

    // Only the server's own acknowledgement removes an entry from the device.
    let script = r#"
        const outbox = openOutbox();
        answers.push(Promise.resolve(new Response("", { status: 200 })));
        answers.push(Promise.resolve(new Response("{}", { status: 200 })));
        const done = saved(outbox);
        outbox.add("/comments", { value: "d" });
        await done;
        return [posted, kept()];
    "#;
    assert_eq!(run(&page, script).await, json!([["d", "d", "d"], 0]));

    // A proxy's page is not an answer of the server.
    let script = r#"
        const outbox = openOutbox();
        answers.push(Promise.resolve(new Response("<h1>Not found</h1>", { status: 404 })));
        const done = saved(outbox);
        outbox.add("/comments", { value: "a" });
        await done;
        return [posted, kept()];
    "#;
    assert_eq!(run(&page, script).await, json!([["a", "a"], 0]), "it is sent again until the server has it");

    // An entry that the server refuses stays on the device, and the next page tries it again.
    let script = r#"
        const outbox = openOutbox();
        answers.push(Promise.resolve(ours(404)));
        const refused = saved(outbox);
        outbox.add("/comments", { session: "s", value: "b" });
        await refused;
        const after = [kept(), outbox.refused("s").length, outbox.refused("t").length];
        const next = openOutbox();
        await saved(next);
        return [posted, ...after, kept(), next.refused("s").length];
    "#;
    assert_eq!(run(&page, script).await, json!([["b", "b"], 1, 1, 0, 0, 0]));

    // Half an emoji, from a text that was cut, does not stop the other entries.
    let script = r#"
        const outbox = openOutbox();
        const done = saved(outbox);
        outbox.add("/comments", { value: "cut \ud83d" });
        await done;
        return posted;
    "#;
    assert_eq!(run(&page, script).await, json!(["cut \u{fffd}"]));

    // A caller that waits for the answers learns that the server is unreachable, even if a comment is first in line.
    let script = r#"
        const outbox = openOutbox();
        answers.push(Promise.reject(new TypeError("Failed to fetch")));
        outbox.add("/comments", { value: "c" });
        outbox.add("/answers", { value: 4 }, "sharpness");
        const settled = await outbox.settled("/answers");
        await saved(outbox);
        return [settled, posted];
    "#;
    assert_eq!(run(&page, script).await, json!([false, ["c", "c", 4]]));
}

/// Checks the reported wait of an entry: whether it is about `expected` seconds, and by which clock.
const WAIT: &str = r#"
    const clock = Date.now;
    const wait = ({ waited_millis: waited, waited_by: by }, expected) =>
        [Math.abs(waited - expected * 1000) < 30000, by];
    /** An entry that the server does not take at first; `meanwhile` happens before it is sent again. */
    const heldBack = async (meanwhile) => {
        const outbox = openOutbox();
        let fail;
        answers.push(new Promise((done) => (fail = () => done(ours(507)))));
        const arrived = new Promise((done) => arrivals.push(done));
        outbox.add("/comments", { value: "held" });
        await arrived;
        const done = saved(outbox);
        meanwhile();
        fail();
        await done;
        Date.now = clock;
        return bodies.at(-1);
    };
"#;

#[tokio::test(flavor = "multi_thread")]
async fn a_clock_that_is_set_moves_no_comment_and_a_tablet_that_sleeps_is_not_taken_for_quick() {
    let driver = Driver::start();
    let server = theatre::server();
    let page = driver.browser().await;
    page.open(&server.link("surgeon")).await;
    let waits = async |script: &str| run(&page, &format!("{WAIT} {script}")).await;

    let forward = "return wait(await heldBack(() => (Date.now = () => clock() + 600000)), 0)";
    assert_eq!(waits(forward).await, json!([true, "page-clock"]));
    let back = "return wait(await heldBack(() => (Date.now = () => clock() - 600000)), 0)";
    assert_eq!(waits(back).await, json!([true, "page-clock"]));

    // Asleep for ten minutes: the page is hidden, and its own clock stands still.
    let asleep = "const sight = (hidden) => {
            Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
            document.dispatchEvent(new Event('visibilitychange'));
        };
        return wait(await heldBack(() => {
            sight(true);
            Date.now = () => clock() + 600000;
            sight(false);
            delete document.hidden;
        }), 600)";
    assert_eq!(waits(asleep).await, json!([true, "wall-clock"]));

    // The entry is kept over a reload, so that no page's clock knows the wait. The real server has no such address and
    // accepts nothing.
    let keep = "answers.push(new Promise(() => {}));
        Date.now = () => clock() - 600000;
        openOutbox().add('/comments', { session: 's', value: 'kept' });
        Date.now = clock;";
    waits(keep).await;
    page.reload().await;
    let again = OUTBOX.replace("localStorage.clear();", "");
    let script = format!(
        "return (async () => {{
            {again} {WAIT}
            const outbox = openOutbox();
            await saved(outbox);
            return wait(bodies[0], 600);
        }})()"
    );

    assert_eq!(page.run(&script, &[]).await, json!([true, "wall-clock"]));
}
