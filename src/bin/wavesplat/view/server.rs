//! The server of the page: it renders what the page asks for, one request after another.

use super::guard;
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Query, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use std::collections::HashMap;
use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use tokio::sync::Semaphore;
use wavesplat::base::error::Result;
use wavesplat::cli::render::Look;
use wavesplat::cli::render::live::{Saved, Scenery};

/// Most bytes of a request.
const MOST_BYTES: usize = 64 << 10;
/// Most requests that are answered or wait at a time.
const MOST_REQUESTS: usize = 64;

/// What all requests share.
pub(super) struct Server {
    scenery: Arc<Scenery>,
    /// What the page is told about the scene, as JSON.
    facts: String,
    token: String,
    /// One request renders at a time, with all threads.
    renders: Arc<Semaphore>,
    requests: Semaphore,
}

type Shared = State<Arc<Server>>;

/// What is wrong with a request, or with rendering it.
struct Failed(StatusCode, String);

impl IntoResponse for Failed {
    fn into_response(self) -> Response {
        (self.0, self.1).into_response()
    }
}

impl Server {
    pub(super) fn new(scenery: Scenery, facts: String, token: String) -> Self {
        let (renders, requests) = (Arc::new(Semaphore::new(1)), Semaphore::new(MOST_REQUESTS));
        Self { scenery: Arc::new(scenery), facts, token, renders, requests }
    }

    /// Answers requests until the program ends.
    pub(super) fn run(self, listener: TcpListener) -> io::Result<()> {
        listener.set_nonblocking(true)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        runtime.block_on(async { axum::serve(tokio::net::TcpListener::from_std(listener)?, self.router()).await })
    }

    fn router(self) -> Router {
        let shared = Arc::new(self);
        let at = |name: &str| format!("/{}/{name}", shared.token);
        let pages = Router::new()
            .route(&at(""), get(page))
            .route(&at("pictures"), post(pictures))
            .route(&at("histogram"), get(histogram))
            .route(&at("command"), post(command))
            .route(&at("save"), post(save));
        let admitted = middleware::from_fn_with_state(shared.clone(), admit);
        pages.with_state(shared).layer(DefaultBodyLimit::max(MOST_BYTES)).layer(admitted)
    }

    /// Does work that renders, after the work before it. If the asker goes away while it waits, it is not done.
    async fn render<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Scenery) -> Result<T> + Send + 'static,
    ) -> std::result::Result<T, Failed> {
        let busy = |_| Failed(StatusCode::SERVICE_UNAVAILABLE, "the server ends".into());
        let turn = self.renders.clone().acquire_owned().await.map_err(busy)?;
        let scenery = self.scenery.clone();
        let done = tokio::task::spawn_blocking(move || {
            let done = work(&scenery);
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

/// Lets requests in that come from the server's own page, and not too many.
async fn admit(State(server): Shared, request: Request, next: Next) -> Response {
    let mut answer = match server.requests.try_acquire() {
        _ if !guard::is_own(request.headers()) => StatusCode::FORBIDDEN.into_response(),
        Ok(_place) => next.run(request).await,
        Err(_) => StatusCode::SERVICE_UNAVAILABLE.into_response(),
    };
    for (name, value) in guard::HEADERS {
        answer.headers_mut().insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    answer
}

async fn page(State(server): Shared) -> std::result::Result<Html<String>, Failed> {
    let failed = |e: wavesplat::base::error::Error| Failed(StatusCode::INTERNAL_SERVER_ERROR, e.to_string());
    let nonce = guard::token().map_err(failed)?;
    Scenery::page(&server.facts, &nonce).map(Html).map_err(failed)
}

async fn pictures(State(server): Shared, body: Bytes) -> std::result::Result<Response, Failed> {
    let look = look(&body)?;
    let pictures = server.render(move |scenery| scenery.pictures(&look)).await?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], pictures).into_response())
}

async fn histogram(State(server): Shared) -> std::result::Result<Response, Failed> {
    let counts = server.render(Scenery::histogram).await?;
    Ok(([(header::CONTENT_TYPE, "application/json")], format!("{counts:?}")).into_response())
}

async fn command(
    State(server): Shared,
    Query(query): Query<HashMap<String, String>>,
    body: Bytes,
) -> std::result::Result<String, Failed> {
    Ok(server.scenery.command(&look(&body)?, saved(&query)?))
}

async fn save(
    State(server): Shared,
    Query(query): Query<HashMap<String, String>>,
    body: Bytes,
) -> std::result::Result<Response, Failed> {
    let (look, saved) = (look(&body)?, saved(&query)?);
    let file = server.render(move |scenery| scenery.save(&look, saved)).await?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], file).into_response())
}

fn look(body: &[u8]) -> std::result::Result<Look, Failed> {
    Look::read(body).map_err(|e| Failed(StatusCode::BAD_REQUEST, e.to_string()))
}

/// The kind of file that is asked for.
fn saved(query: &HashMap<String, String>) -> std::result::Result<Saved, Failed> {
    let known = query.get("file").and_then(|name| Saved::named(name));
    known.ok_or_else(|| Failed(StatusCode::BAD_REQUEST, "file: picture.png, page.html or movie.mp4".into()))
}
