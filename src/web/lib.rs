//! The viewer's engine for browsers: a `ViewerSession` (`jobs/picture`) behind four functions of
//! WebAssembly. `engine/render/page/web/worker.js` calls them.
//!
//! ```text
//! reserve(bytes)                 memory for a name or a body
//! ask(name, body)                whether the answer is an error
//! answer(), answer_bytes()       where the answer is, until the next question
//! ```
//!
//! A question is a name, and a body in JSON:
//!
//! ```text
//! bytes        takes the bytes of a file
//! open         takes an `Opening`: a name, and the length of a file elsewhere if no bytes were given
//! pictures ..  those of `wavesplat_jobs::picture::Question`
//! ```
#![cfg(target_family = "wasm")]

mod host;
mod far;
mod session;
mod exports;
