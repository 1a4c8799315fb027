//! What the surgeon's page keeps until it is saved: the outbox in a real browser, before a server that answers as each test says.

use serde_json::{Value, json};

use crate::theatre;
use crate::webdriver::{Browser, Driver};

/// A fresh outbox as `outbox`; `answers` are given in turn, and what was posted is in `posted`.
const OUTBOX: &str = r#"
    localStorage.clear();
    const page = document.querySelector('script[src*="surgeon.js"]').src;
    const { Outbox } = await import(page.replace("surgeon.js", "outbox.js"));
    const posted = [];
    const answers = [];
    const arrivals = [];
    window.fetch = (path, { body }) => {
        posted.push(JSON.parse(body).value);
        arrivals.shift()?.();
        return answers.shift() ?? Promise.resolve(new Response(null, { status: 204 }));
    };
    const ours = (status) => new Response('{"error": "so it is"}', { status, headers: { "content-type": "application/json" } });
    const saved = (outbox) => new Promise((done) => outbox.addEventListener("change", () => outbox.waiting.length === 0 && done()));
    const kept = () => Object.keys(localStorage).filter((key) => key.startsWith("parfocal.outbox.")).length;
"#;

async fn run(page: &Browser<'_>, script: &str) -> Value {
    page.run(&format!("return (async () => {{ {OUTBOX} {script} }})()"), json!([])).await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_last_answer_counts_and_nothing_refused_is_thrown_away() {
    let driver = Driver::start().await;
    let server = theatre::server();
    let page = driver.browser().await;
    page.open(&server.url(&format!("/enter?key={}", server.key("surgeon")))).await;

    // An answer changed while its first value is on its way to a server whose disk is full.
    let script = r#"
        const outbox = new Outbox();
        let fail;
        answers.push(new Promise((done) => (fail = () => done(ours(507)))));
        const arrived = new Promise((done) => arrivals.push(done));
        outbox.add("/answers", { value: 3 }, "sharpness");
        await arrived;
        outbox.add("/answers", { value: 5 }, "sharpness");
        const done = saved(outbox);
        fail();
        await done;
        return [posted, kept()];
    "#;
    assert_eq!(
        run(&page, script).await,
        json!([[3, 5], 0]),
        "what was replaced is not sent once more, after its successor"
    );

    // The same, when the tablet's clock was set back between the two.
    let script = r#"
        const outbox = new Outbox();
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
        return [posted, kept()];
    "#;
    assert_eq!(run(&page, script).await, json!([[3, 5], 0]), "what was said last counts");

    // Only the server's own word that it is kept takes it off the device.
    let script = r#"
        const outbox = new Outbox();
        answers.push(Promise.resolve(new Response("", { status: 200 })), Promise.resolve(new Response("{}", { status: 200 })));
        const done = saved(outbox);
        outbox.add("/comments", { value: "d" });
        await done;
        return [posted, kept()];
    "#;
    assert_eq!(run(&page, script).await, json!([["d", "d", "d"], 0]));

    // A page of a proxy's is no answer of the server's.
    let script = r#"
        const outbox = new Outbox();
        answers.push(Promise.resolve(new Response("<h1>Not found</h1>", { status: 404 })));
        const done = saved(outbox);
        outbox.add("/comments", { value: "a" });
        await done;
        return [posted, kept()];
    "#;
    assert_eq!(run(&page, script).await, json!([["a", "a"], 0]), "it is sent again until the server has it");

    // What the server refuses stays on the device, and is tried again by the next page.
    let script = r#"
        const outbox = new Outbox();
        answers.push(Promise.resolve(ours(404)));
        const refused = saved(outbox);
        outbox.add("/comments", { session: "s", value: "b" });
        await refused;
        const after = [kept(), outbox.refused("s").length, outbox.refused("t").length];
        const next = new Outbox();
        await saved(next);
        return [posted, ...after, kept(), next.refused("s").length];
    "#;
    assert_eq!(run(&page, script).await, json!([["b", "b"], 1, 1, 0, 0, 0]));

    // Half an emoji, where a text was cut, does not stop the rest.
    let script = r#"
        const outbox = new Outbox();
        const done = saved(outbox);
        outbox.add("/comments", { value: "cut \ud83d" });
        await done;
        return posted;
    "#;
    assert_eq!(run(&page, script).await, json!(["cut \u{fffd}"]));

    // Who waits for the answers hears that the server is not heard, also while a comment is the first in line.
    let script = r#"
        const outbox = new Outbox();
        answers.push(Promise.reject(new TypeError("Failed to fetch")));
        outbox.add("/comments", { value: "c" });
        outbox.add("/answers", { value: 4 }, "sharpness");
        const settled = await outbox.settled("/answers");
        await saved(outbox);
        return [settled, posted];
    "#;
    assert_eq!(run(&page, script).await, json!([false, ["c", "c", 4]]));
}
