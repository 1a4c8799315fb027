//! Actions and queries that are possible only within the page: its network, storage, clocks and pixels.

use serde_json::{Value, json};

use super::driver::Browser;

/// From now on holds each request whose path ends in `arguments[0]`, until `window.release()`; collects their bodies.
const HOLD: &str = "const send = window.fetch;
    window.heldBodies = [];
    const held = new Promise((done) => (window.release = done));
    window.fetch = async (path, request) => {
        if (path.endsWith(arguments[0])) {
            window.heldBodies.push(JSON.parse(request.body));
            await held;
        }
        return send(path, request);
    };";

/// From now on fails each request whose path ends in `arguments[0]`, until `window.release()`.
const CUT: &str = "const send = window.fetch;
    window.fetch = async (path, request) => {
        if (path.endsWith(arguments[0])) throw new TypeError('Failed to fetch');
        return send(path, request);
    };
    window.release = () => {
        window.fetch = send;
        dispatchEvent(new Event('online'));
    };";

/// The network.
impl Browser {
    /// Holds the page's requests to paths that end in `end`, until [`Browser::release`].
    pub async fn hold(&self, end: &str) {
        self.run(HOLD, &[json!(end)]).await;
    }

    /// Fails the page's requests to paths that end in `end`, as a lost network does, until [`Browser::release`].
    pub async fn cut(&self, end: &str) {
        self.run(CUT, &[json!(end)]).await;
    }

    /// Fails all requests of the page, until it is loaded again.
    pub async fn cut_all(&self) {
        self.run("window.fetch = () => Promise.reject(new TypeError('Failed to fetch'))", &[]).await;
    }

    /// Releases the held or cut requests.
    pub async fn release(&self) {
        self.run("window.release()", &[]).await;
    }

    /// The bodies of the requests that were held.
    pub async fn held(&self) -> Vec<Value> {
        self.run("return window.heldBodies", &[]).await.as_array().unwrap().clone()
    }

    /// From the next load on, no page receives anything from the server.
    pub async fn silence(&self) {
        let silence = "window.fetch = () => new Promise(() => {});
            window.WebSocket = class extends EventTarget { close() {} };";
        self.before_each_page(silence).await;
    }

    /// Status and first two bytes of what a researcher's page gets at `path`.
    pub async fn start_of(&self, path: &str) -> String {
        let get = "const answer = new XMLHttpRequest();
            answer.open('GET', arguments[0], false);
            answer.overrideMimeType('text/plain; charset=x-user-defined');
            answer.send();
            return answer.status + ' ' + answer.responseText.slice(0, 2)";
        text(self.run(get, &[json!(path)]).await)
    }
}

/// Storage.
impl Browser {
    /// From the next load on, every page finds the device's storage full.
    pub async fn fill_storage(&self) {
        let full = "Storage.prototype.setItem = () => { throw new DOMException('full', 'QuotaExceededError'); };";
        self.before_each_page(full).await;
    }

    /// The names of unsaved entries and drafts on this device.
    pub async fn kept_on_device(&self) -> Vec<String> {
        let names = "return Object.keys(localStorage).filter((key) => /outbox|draft/.test(key))";
        strings(&self.run(names, &[]).await)
    }

    /// From the next load on, runs `script` before each page's own scripts.
    pub async fn before_each_page(&self, script: &str) {
        self.tools("Page.addScriptToEvaluateOnNewDocument", json!({ "source": script })).await;
    }
}

/// Actions within one turn of the page's event loop, for which no driver is fast enough.
impl Browser {
    /// Drags a slider over `values` and releases it. Returns the slider's value.
    pub async fn drag_slider(&self, css: &str, values: &[f64]) -> String {
        let drag = "const slider = document.querySelector(arguments[0]);
            for (const value of arguments[1]) {
                slider.value = value;
                slider.dispatchEvent(new Event('input'));
            }
            slider.dispatchEvent(new Event('change'));
            return slider.value";
        text(self.run(drag, &[json!(css), json!(values)]).await)
    }

    /// Writes `words` into a field and leaves the page at once.
    pub async fn write_and_leave(&self, css: &str, words: &str) {
        let write = "const area = document.querySelector(arguments[0]);
            area.value = arguments[1];
            area.dispatchEvent(new Event('input'));
            location.replace('about:blank')";
        self.run(write, &[json!(css), json!(words)]).await;
    }

    /// Gives the element the focus, without a click.
    pub async fn focus(&self, css: &str) {
        self.run("document.querySelector(arguments[0]).focus()", &[json!(css)]).await;
    }

    /// Scrolls to the page's top.
    pub async fn to_top(&self) {
        self.run("scrollTo(0, 0)", &[]).await;
    }

    /// Scrolls the element to the middle of the window.
    pub async fn show(&self, css: &str) {
        let scroll = "document.querySelector(arguments[0]).scrollIntoView({ block: 'center', behavior: 'instant' })";
        self.run(scroll, &[json!(css)]).await;
    }
}

/// Queries that no driver offers.
impl Browser {
    /// Whether a field's text fails the check `flag`, such as patternMismatch.
    pub async fn fails(&self, css: &str, flag: &str) -> bool {
        let check = "return document.querySelector(arguments[0]).validity[arguments[1]]";
        self.run(check, &[json!(css), json!(flag)]).await == true
    }

    /// All text on the page, visible or not, except what depends on the stream at the moment.
    pub async fn everything(&self) -> String {
        let page = "const page = document.body.cloneNode(true);
            for (const told of page.querySelectorAll('.viewer-stale, .viewer-heard')) told.remove();
            return page.textContent.replace(/\\s+/g, ' ')";
        text(self.run(page, &[]).await)
    }

    /// Mean gray of the live picture, 0..=255.
    pub async fn brightness(&self) -> f64 {
        let mean = "const from = document.querySelector('#view canvas');
            const small = Object.assign(document.createElement('canvas'), { width: 32, height: 32 });
            const pen = small.getContext('2d');
            pen.drawImage(from, 0, 0, 32, 32);
            const data = pen.getImageData(0, 0, 32, 32).data;
            return data.reduce((sum, one, index) => sum + (index % 4 < 3 ? one : 0), 0) / (3 * 32 * 32)";
        self.run(mean, &[]).await.as_f64().unwrap()
    }
}

fn text(value: Value) -> String {
    let Value::String(text) = value else { panic!("{value} is no text") };
    text
}

fn strings(value: &Value) -> Vec<String> {
    value.as_array().unwrap().iter().map(|one| one.as_str().unwrap().to_owned()).collect()
}
