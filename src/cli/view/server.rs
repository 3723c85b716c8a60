//! The server of the page: it renders what the page asks for, one request after another, as long as the page waits.

use super::guard;
use axum::Router;
use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{Query, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use std::collections::HashMap;
use std::io;
use std::net::TcpListener;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, Semaphore};
use tower_service::Service;
use wavesplat_core::base::cancel::CancelToken;
use wavesplat_core::base::error::Result;
use wavesplat_jobs::picture::{Saved, ViewRequest, ViewerSession};

/// Most bytes of a request.
const MOST_BYTES: usize = 64 << 10;
/// Most requests that are answered or wait at a time.
const MOST_REQUESTS: usize = 64;
/// Most connections at a time. More wait until one ends.
const MOST_CONNECTIONS: usize = 256;
/// The time that a client has to send the head of a request, and then its body.
const PATIENCE: Duration = Duration::from_secs(10);
const PAUSE: Duration = Duration::from_millis(100);

/// What all requests share.
pub(super) struct Server {
    session: Arc<ViewerSession>,
    /// The facts about the scene for the page, as JSON.
    facts: String,
    token: String,
    /// One request renders at a time, with all threads.
    renders: Arc<Semaphore>,
    /// The current work, or the last one.
    work: Mutex<Arc<CancelToken>>,
    requests: Semaphore,
}

/// Stops a server, from any thread.
#[derive(Debug, Clone, Default)]
pub(super) struct Stop(Arc<Notify>);

impl Stop {
    pub(super) fn stop(&self) {
        self.0.notify_one();
    }
}

type Shared = State<Arc<Server>>;

/// Cancels work when it is dropped, such as when the client disconnects.
struct Wait(Arc<CancelToken>);

impl Drop for Wait {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

/// The error of a request, or of rendering it.
struct Failed(StatusCode, String);

impl IntoResponse for Failed {
    fn into_response(self) -> Response {
        (self.0, self.1).into_response()
    }
}

impl Server {
    pub(super) fn new(session: ViewerSession, facts: String, token: String) -> Self {
        let (renders, requests) = (Arc::new(Semaphore::new(1)), Semaphore::new(MOST_REQUESTS));
        Self { session: Arc::new(session), facts, token, renders, work: Mutex::default(), requests }
    }

    /// Answers requests until `stop` is called.
    pub(super) fn run(self, listener: TcpListener, stop: &Stop) -> io::Result<()> {
        listener.set_nonblocking(true)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let ended = runtime.block_on(async {
            let answering = serve(tokio::net::TcpListener::from_std(listener)?, self.router());
            tokio::select! { ended = answering => ended, () = stop.0.notified() => Ok(()) }
        });
        runtime.shutdown_background(); // does not wait for pictures that nobody sees
        ended
    }

    fn router(self) -> Router {
        let shared = Arc::new(self);
        let at = |name: &str| format!("/{}/{name}", shared.token);
        let pages = Router::new()
            .route(&at(""), get(page))
            .route(&at("pictures"), post(pictures))
            .route(&at("progress"), get(progress))
            .route(&at("histogram"), get(histogram))
            .route(&at("series"), post(series))
            .route(&at("command"), post(command))
            .route(&at("save"), post(save));
        let admitted = middleware::from_fn_with_state(shared.clone(), admit);
        pages.with_state(shared).layer(admitted)
    }

    /// Renders, after earlier work has ended. The work ends soon if the client disconnects.
    async fn render<T: Send + 'static>(
        &self,
        work: impl FnOnce(&ViewerSession, &CancelToken) -> Result<T> + Send + 'static,
    ) -> std::result::Result<T, Failed> {
        let busy = |_| Failed(StatusCode::SERVICE_UNAVAILABLE, "the server ends".into());
        let turn = self.renders.clone().acquire_owned().await.map_err(busy)?;
        let (session, wait) = (self.session.clone(), Wait(Arc::default()));
        let own = wait.0.clone();
        self.work.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&own);
        let done = tokio::task::spawn_blocking(move || {
            let done = work(&session, &own).inspect_err(|error| session.reopen_after(error));
            drop(turn);
            done
        });
        match done.await {
            Ok(Ok(done)) => Ok(done),
            Ok(Err(e)) => Err(Failed(StatusCode::BAD_REQUEST, e.to_string())),
            Err(_) => Err(Failed(StatusCode::INTERNAL_SERVER_ERROR, "rendering failed".into())),
        }
    }
}

/// Answers connections side by side.
async fn serve(listener: tokio::net::TcpListener, router: Router) -> io::Result<()> {
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    while let Ok(place) = places.clone().acquire_owned().await {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await; // too many open files: some will close
            continue;
        };
        let router = router.clone();
        let answer = service_fn(move |request| router.clone().call(request));
        let mut http = http1::Builder::new();
        http.timer(TokioTimer::new()).header_read_timeout(PATIENCE);
        tokio::spawn(async move {
            let _ = http.serve_connection(TokioIo::new(stream), answer).await; // the client's fault
            drop(place);
        });
    }
    Ok(())
}

/// Admits requests from the server's own page, at most [`MOST_REQUESTS`] at a time.
async fn admit(State(server): Shared, request: Request, next: Next) -> Response {
    let mut answer = match server.requests.try_acquire() {
        _ if !guard::is_own(request.headers()) => StatusCode::FORBIDDEN.into_response(),
        Ok(_place) => match whole(request).await {
            Some(request) => next.run(request).await,
            None => StatusCode::BAD_REQUEST.into_response(),
        },
        Err(_) => StatusCode::SERVICE_UNAVAILABLE.into_response(),
    };
    for (name, value) in guard::HEADERS {
        answer.headers_mut().insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    answer
}

/// A request with its whole body, unless that is too long or too slow.
async fn whole(request: Request) -> Option<Request> {
    let (head, body) = request.into_parts();
    let read = tokio::time::timeout(PATIENCE, to_bytes(body, MOST_BYTES)).await;
    Some(Request::from_parts(head, Body::from(read.ok()?.ok()?)))
}

async fn page(State(server): Shared) -> std::result::Result<Html<String>, Failed> {
    let failed = |e: wavesplat_core::base::error::Error| Failed(StatusCode::INTERNAL_SERVER_ERROR, e.to_string());
    let nonce = guard::token().map_err(failed)?;
    ViewerSession::page(&server.facts, &nonce).map(Html).map_err(failed)
}

async fn pictures(State(server): Shared, body: Bytes) -> std::result::Result<Response, Failed> {
    let request = view_request(&body)?;
    let pictures = server.render(move |session, work| session.pictures(&request, work)).await?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], pictures).into_response())
}

/// How much of the present work is done, 0 to 1.
async fn progress(State(server): Shared) -> String {
    server.work.lock().unwrap_or_else(PoisonError::into_inner).share().to_string()
}

/// The time series of a point, given as three shares of the axes.
async fn series(State(server): Shared, body: Bytes) -> std::result::Result<Vec<u8>, Failed> {
    let refused = |e: serde_json::Error| Failed(StatusCode::BAD_REQUEST, format!("not a point: {e}"));
    let point: [f64; 3] = serde_json::from_slice(&body).map_err(refused)?;
    server.render(move |session, work| session.series(point, work)).await
}

/// The histogram of the samples of some frames, or of the requested frame.
async fn histogram(
    State(server): Shared,
    Query(query): Query<HashMap<String, String>>,
) -> std::result::Result<Response, Failed> {
    let number = |text: &String| text.parse().map_err(|_| Failed(StatusCode::BAD_REQUEST, "frame: no number".into()));
    let frame = query.get("frame").map(number).transpose()?;
    let histogram = server.render(move |session, work| session.histogram(frame, work)).await?;
    let failed = |e: serde_json::Error| Failed(StatusCode::INTERNAL_SERVER_ERROR, e.to_string());
    let text = serde_json::to_string(&histogram).map_err(failed)?;
    Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
}

async fn command(
    State(server): Shared,
    Query(query): Query<HashMap<String, String>>,
    body: Bytes,
) -> std::result::Result<String, Failed> {
    let (request, saved) = (view_request(&body)?, saved(&query)?);
    server.session.command(&request, saved).map_err(|e| Failed(StatusCode::BAD_REQUEST, e.to_string()))
}

async fn save(
    State(server): Shared,
    Query(query): Query<HashMap<String, String>>,
    body: Bytes,
) -> std::result::Result<Response, Failed> {
    let (request, saved) = (view_request(&body)?, saved(&query)?);
    let file = server.render(move |session, work| session.save(&request, saved, work)).await?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], file).into_response())
}

fn view_request(body: &[u8]) -> std::result::Result<ViewRequest, Failed> {
    ViewRequest::read(body).map_err(|e| Failed(StatusCode::BAD_REQUEST, e.to_string()))
}

/// The kind of the requested file.
fn saved(query: &HashMap<String, String>) -> std::result::Result<Saved, Failed> {
    let known = query.get("file").and_then(|name| Saved::named(name));
    known.ok_or_else(|| Failed(StatusCode::BAD_REQUEST, "file: picture.png, page.html or movie.mp4".into()))
}
