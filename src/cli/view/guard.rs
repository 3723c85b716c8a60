//! Admits requests only from pages of this server, which know its token.

use axum::http::{HeaderMap, HeaderValue, header};
use std::net::SocketAddr;
use wavesplat_core::base::error::{Error, Result};

/// A random word of 128 bits.
pub(super) fn token() -> Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|e| Error::usage(format!("no random numbers for the address: {e}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// The environment variable with the token of the address, for addresses that stay the same.
pub(super) const TOKEN: &str = "WAVESPLAT_TOKEN";

/// The token of the environment, or a new one.
pub(super) fn chosen_token(environment: Option<String>) -> Result<String> {
    let Some(chosen) = environment else { return token() };
    let is_plain = chosen.bytes().all(|letter| letter.is_ascii_alphanumeric() || b"-_".contains(&letter));
    if is_plain && chosen.len() >= 16 {
        return Ok(chosen);
    }
    Err(Error::usage(format!("{TOKEN}: takes 16 or more letters, digits, - and _")))
}

/// Whether a request comes from the page of this server. A host name other than localhost could belong to another site
/// that resolves to this address; a foreign origin is another site's page.
pub(super) fn is_own(headers: &HeaderMap) -> bool {
    let text = |name| headers.get(name).map(HeaderValue::to_str);
    let Some(Ok(host)) = text(header::HOST) else { return false };
    let is_plain = host.parse::<SocketAddr>().is_ok() || host.parse::<std::net::IpAddr>().is_ok();
    let is_local = host.split(':').next() == Some("localhost");
    let is_same = match text(header::ORIGIN) {
        None => true,
        Some(origin) => origin.ok().and_then(|origin| origin.strip_prefix("http://")) == Some(host),
    };
    (is_plain || is_local) && is_same
}

/// Whether a path begins with the token. This takes as long for any wrong word of its length.
pub(super) fn has_token(path: &str, token: &str) -> bool {
    let word = path.strip_prefix('/').and_then(|rest| rest.split('/').next()).unwrap_or_default();
    let differs = word.bytes().zip(token.bytes()).fold(0, |differs, (a, b)| differs | (a ^ b));
    word.len() == token.len() && differs == 0
}

/// Headers that allow browsers to show answers in a page of their own, and nothing else.
pub(super) const HEADERS: [(&str, &str); 5] = [
    ("cache-control", "no-store"),
    ("content-security-policy", "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"),
    ("cross-origin-resource-policy", "same-origin"),
    ("referrer-policy", "no-referrer"),
    ("x-content-type-options", "nosniff"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pages_of_this_server_may_ask() {
        let asks = |host: Option<&str>, origin: Option<&str>| {
            let mut headers = HeaderMap::new();
            let pairs = [(header::HOST, host), (header::ORIGIN, origin)];
            for (name, value) in pairs.into_iter().filter_map(|(name, value)| Some((name, value?))) {
                headers.insert(name, value.parse().expect("a value"));
            }
            is_own(&headers)
        };
        for host in ["127.0.0.1:80", "[::1]:8123", "localhost:8123", "192.168.0.7:9", "127.0.0.1"] {
            assert!(asks(Some(host), None) && asks(Some(host), Some(&format!("http://{host}"))), "{host}");
        }
        for (host, origin) in [
            (None, None),
            (Some("evil.example:8123"), None),
            (Some("127.0.0.1.evil.example"), None),
            (Some("localhost.evil.example"), None),
            (Some("127.0.0.1:80"), Some("http://evil.example")),
            (Some("127.0.0.1:80"), Some("http://127.0.0.1:81")),
            (Some("127.0.0.1:80"), Some("null")),
        ] {
            assert!(!asks(host, origin), "{host:?} {origin:?}");
        }
    }

    #[test]
    fn tokens_can_be_chosen() {
        let chosen = |token: &str| chosen_token(Some(token.into())).ok();
        assert_eq!(chosen("abcdefgh-0123_456"), Some("abcdefgh-0123_456".into()));
        assert_eq!([chosen(""), chosen("0123456789abcde"), chosen("0123456789/abcdef")], [None, None, None]);
        assert_eq!(chosen_token(None).expect("a token").len(), 32);
    }

    #[test]
    fn paths_begin_with_the_token() {
        for (path, has) in [
            ("/abc/", true),
            ("/abc/pictures", true),
            ("/abc", true),
            ("abc/", false),
            ("/abcd/", false),
            ("/ab/", false),
            ("/abd/abc/", false),
            ("//abc/", false),
            ("/", false),
            ("", false),
        ] {
            assert_eq!(has_token(path, "abc"), has, "{path}");
        }
    }

    #[test]
    fn tokens_differ() {
        let [a, b] = [token().expect("a token"), token().expect("a token")];
        assert!(a != b && a.len() == 32);
    }
}
