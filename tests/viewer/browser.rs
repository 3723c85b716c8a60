//! A browser without a window. It takes commands through pipes: <https://chromedevtools.github.io/devtools-protocol/>.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A page that takes longer to do what it must hangs.
const LONGEST: Duration = Duration::from_secs(60);

/// One browser at a time: it takes more than one processor.
static TURN: Mutex<()> = Mutex::new(());

pub(super) struct Browser {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    session: Option<String>,
    asked: u64,
    /// What the page wrote to its console, and errors that nothing caught.
    pub(super) complaints: Vec<String>,
    _profile: TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Browser {
    /// Starts the browser, with a window of this size. Says so if there is none.
    #[allow(clippy::print_stderr)]
    pub(super) fn start(size: [u32; 2]) -> Option<Self> {
        let names = ["chromium", "chromium-browser", "google-chrome"];
        let is_there = |name: &&str| Command::new(name).arg("--version").output().is_ok();
        let Some(name) = names.into_iter().find(is_there) else {
            eprintln!("not run: chromium is not installed");
            return None;
        };
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let profile = tempfile::tempdir().unwrap();
        let flags = "--headless=new --no-sandbox --disable-gpu --no-proxy-server --remote-debugging-pipe";
        let folder = profile.path().display();
        let line = format!("exec {name} {flags} --user-data-dir='{folder}' about:blank 3<&0 4>&1 >/dev/null 2>&1");
        let mut command = Command::new("sh");
        let mut child = command.args(["-c", &line]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (input, output) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
        let (session, complaints) = (None, Vec::new());
        let mut browser = Self { child, input, output, session, asked: 0, complaints, _profile: profile, _turn: turn };
        let target = browser.ask("Target.createTarget", &json!({ "url": "about:blank" }))["targetId"].clone();
        let attached = browser.ask("Target.attachToTarget", &json!({ "targetId": target, "flatten": true }));
        browser.session = Some(attached["sessionId"].as_str().unwrap().into());
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.ask(&format!("{domain}.enable"), &json!({}));
        }
        browser.resize(size);
        Some(browser)
    }

    pub(super) fn resize(&mut self, [width, height]: [u32; 2]) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.ask("Emulation.setDeviceMetricsOverride", &size);
    }

    /// Sends a command, and waits for its result. Keeps complaints that come before it.
    fn ask(&mut self, method: &str, parameters: &Value) -> Value {
        self.asked += 1;
        let mut message = json!({ "id": self.asked, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.input.write_all(format!("{message}\0").as_bytes()).unwrap();
        loop {
            let answer = self.next();
            match answer["method"].as_str() {
                Some("Log.entryAdded") if answer["params"]["entry"]["level"] != "error" => {}
                Some("Runtime.exceptionThrown" | "Log.entryAdded" | "Page.javascriptDialogOpening") => {
                    self.complaints.push(answer["params"].to_string());
                }
                Some(_) => {}
                None if answer["id"] == self.asked => {
                    assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                    return answer["result"].clone();
                }
                None => {}
            }
        }
    }

    fn next(&mut self) -> Value {
        let mut bytes = Vec::new();
        self.output.read_until(0, &mut bytes).unwrap();
        serde_json::from_slice(bytes.strip_suffix(&[0]).expect("the browser ended")).unwrap()
    }

    pub(super) fn open(&mut self, address: &str) {
        self.ask("Page.navigate", &json!({ "url": address }));
        self.wait("document.readyState === 'complete' && typeof player === 'object'");
    }

    pub(super) fn open_file(&mut self, path: &Path) {
        self.open(&format!("file://{}", path.display()));
    }

    /// The value of an expression, or of what it promises.
    #[track_caller]
    pub(super) fn js(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let answer = self.ask("Runtime.evaluate", &asked);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    #[track_caller]
    pub(super) fn wait(&mut self, expression: &str) {
        assert!(self.has(expression), "never {expression}: {:?}", self.complaints);
    }

    /// Whether an expression becomes true in time.
    pub(super) fn has(&mut self, expression: &str) -> bool {
        let started = Instant::now();
        while self.js(&format!("!!({expression})")) != true {
            if started.elapsed() > LONGEST {
                return false;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        true
    }

    pub(super) fn reload(&mut self) {
        self.js("void (window.player = null)");
        self.ask("Page.reload", &json!({}));
        self.wait("document.readyState === 'complete' && typeof player === 'object' && player !== null");
    }

    /// Makes the network slow, or as it was.
    pub(super) fn slow_network(&mut self, is_slow: bool) {
        let bytes = if is_slow { 1e6 } else { -1.0 };
        let state = json!({ "offline": false, "latency": if is_slow { 60 } else { 0 }, "downloadThroughput": bytes, "uploadThroughput": bytes });
        self.ask("Network.emulateNetworkConditions", &state);
    }

    /// The RGB bytes of the picture.
    pub(super) fn picture(&mut self) -> ([usize; 2], Vec<u8>) {
        let read = "(() => { const c = element('picture'), rgba = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
            let text = ''; for (let i = 0; i < rgba.length; i += 8192) text += String.fromCharCode(...rgba.subarray(i, i + 8192)); \
            return [c.width, c.height, btoa(text)]; })()";
        let found = self.js(read);
        let side = |n: usize| usize::try_from(found[n].as_u64().unwrap()).unwrap();
        let rgba = BASE64.decode(found[2].as_str().unwrap()).unwrap();
        ([side(0), side(1)], rgba.chunks(4).flat_map(|pixel| pixel[..3].to_vec()).collect())
    }

    /// Sets a control of the page, as a user does.
    pub(super) fn set(&mut self, id: &str, value: &Value) {
        let property = if value.is_boolean() { "checked" } else { "value" };
        self.js(&format!(
            "(() => {{ const radio = document.querySelector(`[name='{id}'][value='${{{value}}}']`), e = radio ?? element('{id}'); \
             if (radio) radio.checked = true; else e.{property} = {value}; \
             for (const n of ['input', 'change']) e.dispatchEvent(new Event(n, {{ bubbles: true }})); }})()"
        ));
    }

    pub(super) fn key(&mut self, key: &str) {
        for kind in ["keyDown", "keyUp"] {
            self.ask("Input.dispatchKeyEvent", &json!({ "type": kind, "key": key }));
        }
    }

    /// Presses the space bar, which writes a space.
    pub(super) fn space(&mut self) {
        for (kind, text) in [("keyDown", " "), ("keyUp", "")] {
            let event = json!({ "type": kind, "key": " ", "code": "Space", "text": text, "windowsVirtualKeyCode": 32 });
            self.ask("Input.dispatchKeyEvent", &event);
        }
    }

    /// Clicks in the middle of the picture: `[1, 2]` is a double click.
    pub(super) fn click(&mut self, counts: &[u32]) {
        for n in counts {
            self.pointer("mousePressed", [0.0; 2], &json!({ "buttons": 1, "clickCount": n }));
            self.pointer("mouseReleased", [0.0; 2], &json!({ "clickCount": n }));
        }
    }

    /// A pointer's event in the middle of the picture, and this far from it. The left button is down if `is_down`.
    pub(super) fn pointer(&mut self, kind: &str, [dx, dy]: [f64; 2], more: &Value) {
        let box_ = self.js("(() => { const b = element('picture').getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]; })()");
        let [x, y] = [0, 1].map(|n| box_[n].as_f64().unwrap());
        let mut event = json!({ "type": kind, "x": x + dx, "y": y + dy, "button": "left", "clickCount": 1 });
        event.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.ask("Input.dispatchMouseEvent", &event);
    }

    /// Drags from the middle.
    pub(super) fn drag(&mut self, by: [f64; 2], more: &Value) {
        let mut held = json!({ "buttons": 1 });
        held.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.pointer("mousePressed", [0.0; 2], &held);
        for part in 1..=5 {
            self.pointer("mouseMoved", by.map(|along| along * f64::from(part) / 5.0), &held);
        }
        self.pointer("mouseReleased", by, more);
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
