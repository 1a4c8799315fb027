//! Controls a browser: headless Chromium through chromedriver, by the W3C `WebDriver` protocol.
//!
//! Elements are named by CSS selectors. Actions wait until they are possible; queries ask once.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use fantoccini::actions::{InputSource, KeyAction, KeyActions, MOUSE_BUTTON_LEFT, MouseActions, PointerAction};
use fantoccini::elements::Element;
use fantoccini::error::CmdError;
use fantoccini::key::Key;
use fantoccini::wd::WindowHandle;
use fantoccini::{Client, Locator};
use reqwest::Url;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::pool::{self, Chromium};
use super::wait::{comes_true, until};

/// Functions for the scripts below. What a person reads of an element: nothing if there is none or it is not shown.
const READ: &str =
    "const shown = (element) => element.checkVisibility({ opacityProperty: true, visibilityProperty: true });
    const read = (element) => {
        if (!element || !shown(element)) return '';
        return (element.innerText ?? element.textContent).replaceAll('\\u00a0', ' ').trim();
    };";

/// Waits within the page, so that the browser is not asked again and again. What `met` says, or false after a second:
/// then whoever waits asks anew.
const WAIT: &str = "return new Promise((done) => {
        const end = performance.now() + 1000;
        const look = () => {
            const isMet = met();
            if (isMet || performance.now() > end) done(isMet);
            else setTimeout(look, 100);
        };
        look();
    });";

/// Prepares for a click on the element: tells whether it takes one, and notes in `reached` whether the next click of the
/// page reaches it, before the page's own listeners.
const EXPECT_CLICK: &str = "const [element] = arguments;
    if (element.matches(':disabled')) return false;
    window.reached = false;
    const note = (event) => (window.reached = event.composedPath().includes(element));
    addEventListener('click', note, { capture: true, once: true });
    return true;";

/// What starts browsers. All tests share one chromedriver, which ends with the test program.
pub struct Driver(());

impl Driver {
    /// Starts chromedriver at the first browser, unless another test has.
    pub const fn start() -> Self {
        Self(())
    }

    /// A browser without memory of anything. Another test may have used it.
    pub async fn browser(&self) -> Browser {
        Browser::controls(pool::borrow().await, true)
    }

    /// A browser of this test's own, with additional options of Chromium; without options, any browser.
    pub async fn browser_with(&self, options: &[String]) -> Browser {
        if options.is_empty() {
            return self.browser().await;
        }
        Browser::controls(pool::start(pool::profile(), options, json!({})).await, false)
    }

    /// A browser whose user has doubled the text size.
    pub async fn browser_with_large_text(&self) -> Browser {
        let large = json!({ "webkit.webprefs.default_font_size": 32 });
        Browser::controls(pool::start(pool::profile(), &[], large).await, false)
    }

    /// The browser of a tablet that lost power and is switched on again: `browser` ends at once, without writing
    /// anything more, and another starts with what is on its disk.
    pub async fn after_power_cut(&self, browser: &Browser, options: &[String]) -> Browser {
        assert!(!browser.is_shared, "no other test may get a browser without power");
        // Chromium's lock on its profile names its process.
        let lock = std::fs::read_link(browser.profile.path().join("SingletonLock")).unwrap();
        let process = lock.to_str().and_then(|lock| lock.rsplit('-').next()?.parse().ok()).and_then(Pid::from_raw);
        let process = process.expect("the lock ends with a process's number");
        // One of its processes has the disk, and would go on a little without the browser.
        let processes = with_descendants(process);
        for &process in &processes {
            // One may just have ended by itself.
            let _ = kill_process(process, Signal::KILL);
        }

        // An ended process stays listed as a zombie until its parent waits for it.
        let stat = |process: &Pid| std::fs::read_to_string(format!("/proc/{process}/stat"));
        let is_gone = |process: &Pid| stat(process).map_or(true, |stat| stat.contains(") Z "));
        until("the browser to be gone", || async { processes.iter().all(is_gone) }).await;
        Browser::controls(pool::start(Arc::clone(&browser.profile), options, json!({})).await, false)
    }
}

/// `process`, the processes that it started, and theirs.
fn with_descendants(process: Pid) -> Vec<Pid> {
    let mut found = vec![process];
    let mut next = 0;
    while let Some(parent) = found.get(next) {
        let threads = std::fs::read_dir(format!("/proc/{parent}/task")).into_iter().flatten().flatten();
        let children = threads.flat_map(|thread| std::fs::read_to_string(thread.path().join("children")));
        let children: String = children.collect();
        found.extend(children.split_whitespace().filter_map(|child| Pid::from_raw(child.parse().ok()?)));
        next += 1;
    }
    found
}

/// A box on the page, in CSS pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Area {
    /// Right edge.
    pub fn right(self) -> f64 {
        self.left + self.width
    }

    /// Lower edge.
    pub fn bottom(self) -> f64 {
        self.top + self.height
    }
}

/// A browser with a profile of its own.
pub struct Browser {
    client: Client,
    /// Chromium's profile, which stands for a tablet's disk.
    profile: Arc<TempDir>,
    /// Whether other tests may use it afterwards.
    is_shared: bool,
    /// Origins of the pages that were opened.
    origins: Mutex<BTreeSet<String>>,
}

impl Browser {
    fn controls(chromium: Chromium, is_shared: bool) -> Self {
        let Chromium { client, profile } = chromium;
        Self { client, profile, is_shared, origins: Mutex::default() }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let chromium = Chromium { client: self.client.clone(), profile: Arc::clone(&self.profile) };
        let origins = std::mem::take(&mut *self.origins.lock().unwrap_or_else(PoisonError::into_inner));
        // Nobody knows what a failed test left in it.
        if self.is_shared && !std::thread::panicking() {
            pool::give_back(chromium, origins);
        } else {
            pool::end(chromium);
        }
    }
}

/// Pages and tabs.
impl Browser {
    /// Opens `url`.
    pub async fn open(&self, url: &str) {
        let origin = Url::parse(url).unwrap().origin().ascii_serialization();
        self.origins.lock().unwrap().insert(origin);
        self.client.goto(url).await.unwrap();
    }

    /// Reloads the page.
    pub async fn reload(&self) {
        self.client.refresh().await.unwrap();
    }

    /// Opens a second tab on `url` and switches to it. Returns the first.
    pub async fn new_tab(&self, url: &str) -> WindowHandle {
        let first = self.client.window().await.unwrap();
        let tab = self.client.new_window(true).await.unwrap();
        self.client.switch_to_window(tab.handle).await.unwrap();
        self.open(url).await;
        first
    }

    /// Switches to `tab`. Returns the tab that was left.
    pub async fn to_tab(&self, tab: &WindowHandle) -> WindowHandle {
        let left = self.client.window().await.unwrap();
        self.client.switch_to_window(tab.clone()).await.unwrap();
        left
    }

    /// Closes the tab and switches back to `tab`.
    pub async fn close_tab(&self, tab: &WindowHandle) {
        self.client.close_window().await.unwrap();
        self.client.switch_to_window(tab.clone()).await.unwrap();
    }

    /// The visible page as a PNG.
    pub async fn screenshot(&self) -> Vec<u8> {
        self.client.screenshot().await.unwrap()
    }

    /// Executes a command of the developer tools.
    pub async fn tools(&self, command: &str, parameters: Value) -> Value {
        pool::tools(&self.client, command, parameters).await.unwrap_or_else(|error| panic!("{command}: {error}"))
    }

    /// Touches the screen with a finger at each of these points; without points, lifts the fingers.
    pub async fn touch(&self, kind: &str, points: &[(f64, f64)]) {
        let points: Vec<Value> =
            points.iter().enumerate().map(|(id, (x, y))| json!({ "x": x, "y": y, "id": id })).collect();
        self.tools("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": points })).await;
    }

    /// Errors logged by the page's scripts since the last call.
    pub async fn complaints(&self) -> Vec<String> {
        let log = pool::log(&self.client).await.unwrap();
        let severe = log.as_array().into_iter().flatten().filter(|line| line["level"] == "SEVERE");
        severe.map(|line| line["message"].as_str().unwrap_or_default().to_owned()).collect()
    }

    /// Runs `script`, the body of a function of `arguments`, and returns its result. See [`super::scripts`].
    pub async fn run(&self, script: &str, arguments: &[Value]) -> Value {
        self.client.execute(script, arguments.to_vec()).await.unwrap_or_else(|error| panic!("{error}: {script}"))
    }
}

/// Actions on a page.
impl Browser {
    /// Clicks with the pointer as soon as that is possible.
    pub async fn click(&self, css: &str) {
        until(&format!("{css} to be clickable"), || async { self.try_click(css).await }).await;
    }

    /// Clicks if that is possible. Returns whether it was.
    pub async fn try_click(&self, css: &str) -> bool {
        let Ok(element) = self.find(css).await else { return false };
        self.click_element(element).await
    }

    /// Clicks on the element if it takes clicks. Returns whether the click reached it: on a page that grows meanwhile it
    /// may meet something else.
    async fn click_element(&self, element: Element) -> bool {
        let expected = self.client.execute(EXPECT_CLICK, vec![json!(element)]).await;
        if !expected.is_ok_and(|expected| expected == true) || element.click().await.is_err() {
            return false;
        }

        let reached = self.client.execute("return window.reached", Vec::new()).await;
        // A page that the click has left has nothing to say.
        reached.map_or(true, |reached| reached != false)
    }

    /// Clicks on the button within `css` whose label starts with `label`.
    pub async fn click_labelled(&self, css: &str, label: &str) {
        until(&format!("the button '{label}'"), || async {
            for button in self.all(&format!("{css} button")).await {
                if button.text().await.is_ok_and(|text| text.starts_with(label)) {
                    return self.click_element(button).await;
                }
            }

            false
        })
        .await;
    }

    /// Clicks twice, as fast as a pointer can.
    pub async fn double_click(&self, css: &str) {
        let element = self.find(css).await.unwrap();
        let to = PointerAction::MoveToElement { element, duration: None, x: 0.0, y: 0.0 };
        let down = PointerAction::Down { button: MOUSE_BUTTON_LEFT };
        let up = PointerAction::Up { button: MOUSE_BUTTON_LEFT };
        let twice = [to, down.clone(), up.clone(), down, up];
        let mouse = twice.into_iter().fold(MouseActions::new("mouse".to_owned()), MouseActions::then);
        self.client.perform_actions(mouse).await.unwrap();
    }

    /// Types `text` after the existing text, as soon as the element accepts keys.
    pub async fn type_into(&self, css: &str, text: &str) {
        until(&format!("{css} to take keys"), || async {
            let Ok(element) = self.find(css).await else { return false };
            element.send_keys(text).await.is_ok()
        })
        .await;
    }

    /// Presses and releases `key`, wherever the focus is.
    pub async fn press(&self, key: char) {
        let keys = KeyActions::new("keyboard".to_owned());
        let keys = keys.then(KeyAction::Down { value: key }).then(KeyAction::Up { value: key });
        self.client.perform_actions(keys).await.unwrap();
    }

    /// Empties the field.
    pub async fn clear(&self, css: &str) {
        self.find(css).await.unwrap().clear().await.unwrap();
    }

    /// Replaces the existing text by pasting `text`.
    pub async fn paste(&self, css: &str, text: &str) {
        self.click(css).await;
        let all = format!("{}a{}", char::from(Key::Control), char::from(Key::Null));
        self.type_into(css, &all).await;
        self.tools("Input.insertText", json!({ "text": text })).await;
    }

    /// Inserts `text` at the cursor, as a tablet's keyboard does.
    pub async fn insert(&self, text: &str) {
        self.tools("Input.insertText", json!({ "text": text })).await;
    }

    /// Chooses the option `value` of a list.
    pub async fn select(&self, css: &str, value: &str) {
        until(&format!("{css} to offer {value}"), || async {
            let Ok(list) = self.find(css).await else { return false };
            let _ = list.select_by_value(value).await;
            list.prop("value").await.is_ok_and(|chosen| chosen.as_deref() == Some(value))
        })
        .await;
    }
}

/// What a page shows.
impl Browser {
    /// Waits until the element is shown and its text contains `text`.
    pub async fn sees(&self, css: &str, text: &str) {
        let met = "const met = () => read(document.querySelector(arguments[0])).includes(arguments[1]);";
        let seen = comes_true(async || self.meets(met, &[json!(css), json!(text)]).await).await;
        assert!(seen, "{css} never says '{text}', but '{}'", self.text(css).await);
    }

    /// Waits until nothing that `css` selects is shown.
    pub async fn sees_no(&self, css: &str) {
        let met = "const met = () => ![...document.querySelectorAll(arguments[0])].some(shown);";
        until(&format!("{css} to be gone"), async || self.meets(met, &[json!(css)]).await).await;
    }

    /// Waits within the page, but not for long, until the function `met`, which this script defines, says so.
    async fn meets(&self, met: &str, arguments: &[Value]) -> bool {
        let script = format!("{READ} {met} {WAIT}");
        // A page that is being replaced answers with an error.
        self.client.execute(&script, arguments.to_vec()).await.is_ok_and(|met| met == true)
    }

    /// Text of the element; empty if there is none or it is not shown.
    pub async fn text(&self, css: &str) -> String {
        let script = format!("{READ} return read(document.querySelector(arguments[0]))");
        loop {
            match self.client.execute(&script, vec![json!(css)]).await {
                Ok(text) => return text.as_str().expect("text").to_owned(),
                // The page was being replaced.
                Err(error) if error.to_string().contains("aborted by navigation") => {}
                Err(error) => panic!("{css}: {error}"),
            }
        }
    }

    /// The value of a field.
    pub async fn value(&self, css: &str) -> String {
        self.property(css, "value").await.unwrap_or_default()
    }

    /// The value of each field.
    pub async fn values(&self, css: &str) -> Vec<String> {
        self.properties(css, "value").await
    }

    /// Whether the element has `property`, such as disabled.
    pub async fn is(&self, css: &str, property: &str) -> bool {
        self.property(css, property).await.as_deref() == Some("true")
    }

    /// A property of the element; `None` if it is null or there is no such element.
    pub async fn property(&self, css: &str, property: &str) -> Option<String> {
        self.find(css).await.ok()?.prop(property).await.ok().flatten()
    }

    /// A property of each element.
    pub async fn properties(&self, css: &str, property: &str) -> Vec<String> {
        let mut values = Vec::new();
        for element in self.all(css).await {
            values.extend(element.prop(property).await.unwrap());
        }
        values
    }

    /// An attribute of the element; `None` if there is no such element or attribute.
    pub async fn attribute(&self, css: &str, attribute: &str) -> Option<String> {
        self.find(css).await.ok()?.attr(attribute).await.ok().flatten()
    }

    /// The computed value of a CSS property.
    pub async fn style(&self, css: &str, property: &str) -> String {
        self.find(css).await.unwrap().css_value(property).await.unwrap()
    }

    /// Number of elements, shown or not.
    pub async fn count(&self, css: &str) -> usize {
        self.all(css).await.len()
    }

    /// Position and size of the element.
    pub async fn area(&self, css: &str) -> Area {
        area(&self.find(css).await.unwrap()).await
    }

    /// Position and size of each element.
    pub async fn areas(&self, css: &str) -> Vec<Area> {
        let mut areas = Vec::new();
        for element in self.all(css).await {
            areas.push(area(&element).await);
        }
        areas
    }

    async fn find(&self, css: &str) -> Result<Element, CmdError> {
        self.client.find(Locator::Css(css)).await
    }

    async fn all(&self, css: &str) -> Vec<Element> {
        self.client.find_all(Locator::Css(css)).await.unwrap()
    }
}

async fn area(element: &Element) -> Area {
    let (left, top, width, height) = element.rectangle().await.unwrap();
    Area { left, top, width, height }
}
