//! The server of the page: it renders what the page asks for, one request after another, as long as the page waits.

use super::answers::AnswerRoom;
use super::connections::{Connection, Connections, PATIENCE, Patient};
use super::guard;
use axum::Router;
use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{Path, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use std::convert::Infallible;
use std::io;
use std::net::TcpListener;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, Semaphore};
use tower_service::Service;
use wavesplat_core::base::cancel::CancelToken;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_jobs::picture::{Question, ViewerSession};

/// Most bytes of a request.
const MOST_BYTES: usize = 64 << 10;
/// Most bytes of the head of a request, and of a body that is read at a time.
const MOST_HEAD: usize = 16 << 10;
/// Most requests that are answered or wait at a time.
const MOST_REQUESTS: usize = 64;
/// The wait until a connection can be taken again.
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
    answers: AnswerRoom,
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
        let answers = AnswerRoom::new(session.memory_of_answers());
        Self { session: Arc::new(session), facts, token, renders, work: Mutex::default(), requests, answers }
    }

    /// Answers requests until `stop` is called.
    pub(super) fn run(self, listener: TcpListener, stop: &Stop) -> io::Result<()> {
        listener.set_nonblocking(true)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let ended = runtime.block_on(async {
            let answering = serve(tokio::net::TcpListener::from_std(listener)?, Arc::new(self));
            tokio::select! { ended = answering => ended, () = stop.0.notified() => Ok(()) }
        });
        runtime.shutdown_background(); // does not wait for pictures that nobody sees
        ended
    }

    fn router(self: &Arc<Self>) -> Router {
        let at = |name: &str| format!("/{}/{name}", self.token);
        let pages = Router::new()
            .route(&at(""), get(page))
            .route(&at("progress"), get(progress))
            .route(&at("{question}"), post(answer));
        pages.with_state(self.clone())
    }

    /// Renders, after earlier work has ended, and waits until the result has room. The work ends soon if the client
    /// disconnects.
    async fn render(
        &self,
        work: impl FnOnce(&ViewerSession, &CancelToken) -> Result<Vec<u8>> + Send + 'static,
    ) -> std::result::Result<Bytes, Failed> {
        let busy = |_| Failed(StatusCode::SERVICE_UNAVAILABLE, "the server ends".into());
        let turn = self.renders.clone().acquire_owned().await.map_err(busy)?;
        let (session, wait) = (self.session.clone(), Wait(Arc::default()));
        let own = wait.0.clone();
        self.work.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&own);
        let done = tokio::task::spawn_blocking(move || {
            let done = work(&session, &own).inspect_err(|error| session.reopen_after(error));
            (done, turn)
        });
        match done.await {
            Ok((Ok(done), turn)) => Ok(self.answers.hold(done, turn).await),
            Ok((Err(e), _)) => Err(Failed(StatusCode::BAD_REQUEST, e.to_string())),
            Err(_) => Err(Failed(StatusCode::INTERNAL_SERVER_ERROR, "rendering failed".into())),
        }
    }

    /// Why a request gets no answer, from its head alone; none if it comes from the server's own page, with the token.
    fn refusal(&self, request: &Request) -> Option<StatusCode> {
        match guard::is_own(request.headers()) {
            false => Some(StatusCode::FORBIDDEN),
            true if !guard::has_token(request.uri().path(), &self.token) => Some(StatusCode::NOT_FOUND),
            true => None,
        }
    }

    /// Answers a request of a connection.
    async fn answer(&self, connection: &Connection, router: Router, request: Request) -> Response {
        let mut answer = match self.refusal(&request) {
            Some(status) => closing(status),
            None if !connection.is_placed() => closing(StatusCode::SERVICE_UNAVAILABLE),
            None => self.admitted(router, request).await,
        };
        for (name, value) in guard::HEADERS {
            answer.headers_mut().insert(HeaderName::from_static(name), HeaderValue::from_static(value));
        }
        answer
    }

    /// Answers a request with the token, at most [`MOST_REQUESTS`] at a time.
    async fn admitted(&self, mut router: Router, request: Request) -> Response {
        let Ok(_permit) = self.requests.try_acquire() else { return closing(StatusCode::SERVICE_UNAVAILABLE) };
        let Some(request) = whole(request).await else { return closing(StatusCode::BAD_REQUEST) };
        router.call(request).await.unwrap_or_else(|never| match never {})
    }
}

/// An answer without content, after which the connection closes.
fn closing(status: StatusCode) -> Response {
    (status, [(header::CONNECTION, "close")]).into_response()
}

/// Answers connections side by side.
async fn serve(listener: tokio::net::TcpListener, server: Arc<Server>) -> io::Result<()> {
    let (router, connections) = (server.router(), Connections::new());
    for number in 0.. {
        let Ok((stream, _)) = listener.accept().await else {
            connections.close_oldest(); // too many open files
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let connection = Arc::new(connections.connection(number));
        let (router, server) = (router.clone(), server.clone());
        let answer = service_fn(move |request: hyper::Request<Incoming>| {
            let (connection, router, server) = (connection.clone(), router.clone(), server.clone());
            async move { Ok::<_, Infallible>(server.answer(&connection, router, request.map(Body::new)).await) }
        });
        let mut http = http1::Builder::new();
        http.timer(TokioTimer::new()).header_read_timeout(PATIENCE).max_buf_size(MOST_HEAD);
        let served = http.serve_connection(TokioIo::new(Patient::new(stream)), answer);
        let task = tokio::spawn(async move {
            let _ = served.await; // the client's fault
        });
        connections.add(number, task.abort_handle());
        tokio::task::yield_now().await; // it reads what has arrived before another comes
    }
    Ok(())
}

/// A request with its whole body, unless that is too long or too slow.
async fn whole(request: Request) -> Option<Request> {
    let (head, body) = request.into_parts();
    let read = tokio::time::timeout(PATIENCE, to_bytes(body, MOST_BYTES)).await;
    Some(Request::from_parts(head, Body::from(read.ok()?.ok()?)))
}

async fn page(State(server): Shared) -> std::result::Result<Html<String>, Failed> {
    let failed = |e: Error| Failed(StatusCode::INTERNAL_SERVER_ERROR, e.to_string());
    let nonce = guard::token().map_err(failed)?;
    ViewerSession::page(&server.facts, &nonce).map(Html).map_err(failed)
}

/// How much of the present work is done, 0 to 1.
async fn progress(State(server): Shared) -> String {
    server.work.lock().unwrap_or_else(PoisonError::into_inner).share().to_string()
}

/// Answers a question of the page.
async fn answer(State(server): Shared, Path(name): Path<String>, body: Bytes) -> std::result::Result<Response, Failed> {
    let refused = |e: Error| Failed(StatusCode::BAD_REQUEST, e.to_string());
    let question = Question::read(&name, &body).map_err(refused)?;
    let answer = if question.is_quick() {
        server.session.answer(&question, &CancelToken::default()).map_err(refused)?.into()
    } else {
        server.render(move |session, work| session.answer(&question, work)).await?
    };
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], answer).into_response())
}
