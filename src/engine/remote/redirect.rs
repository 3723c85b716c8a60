//! Redirects: the address that an answer sends to, and whether it is of the same server.

use ureq::http::Uri;
use ureq::http::uri::Scheme;

/// Redirects that are followed for one request.
pub(super) const MOST_REDIRECTS: usize = 10;

/// Whether an answer sends elsewhere.
pub(super) fn is_redirect(status: u16) -> bool {
    matches!(status, 301 | 302 | 303 | 307 | 308)
}

/// Whether two addresses have the same scheme, host and port. Secrets for one are then for the other, too.
pub(super) fn is_same_server(a: &Uri, b: &Uri) -> bool {
    let host = |uri: &Uri| uri.host().map(str::to_ascii_lowercase);
    a.scheme() == b.scheme() && host(a) == host(b) && port(a) == port(b)
}

fn port(uri: &Uri) -> Option<u16> {
    let usual = if uri.scheme() == Some(&Scheme::HTTPS) { 443 } else { 80 };
    uri.authority().map(|of| of.port_u16().unwrap_or(usual))
}

/// The address that the `Location` of an answer from another means; none if it is not one of HTTP. Names and passwords in
/// it are left out.
pub(super) fn target(from: &Uri, location: &str) -> Option<Uri> {
    let location = location.split('#').next().unwrap_or_default().trim().replace(' ', "%20");
    let (scheme, authority, path) = (from.scheme_str()?, from.authority()?, from.path());
    let absolute = match location.as_str() {
        "" => from.to_string(),
        whole if has_scheme(whole) => whole.into(),
        rest if rest.starts_with("//") => format!("{scheme}:{rest}"),
        rest if rest.starts_with('/') => format!("{scheme}://{authority}{rest}"),
        rest if rest.starts_with('?') => format!("{scheme}://{authority}{path}{rest}"),
        rest => format!("{scheme}://{authority}{}", without_dots(&path[..=path.rfind('/')?], rest)),
    };
    nameless(&absolute.parse().ok()?)
}

/// Whether a reference begins with a scheme.
fn has_scheme(reference: &str) -> bool {
    let start = reference.split(['/', '?']).next().unwrap_or_default();
    start.split_once(':').is_some_and(|(scheme, _)| scheme.starts_with(|first: char| first.is_ascii_alphabetic()))
}

/// A path relative to a folder, without its steps `.` and `..`.
fn without_dots(folder: &str, relative: &str) -> String {
    let (path, query) = relative.find('?').map_or((relative, ""), |at| relative.split_at(at));
    let mut steps: Vec<&str> = folder.split('/').filter(|step| !step.is_empty()).collect();
    for step in path.split('/') {
        match step {
            "." => {}
            ".." => drop(steps.pop()),
            step => steps.push(step),
        }
    }
    format!("/{}{query}", steps.join("/"))
}

/// An address of HTTP without a name and a password.
fn nameless(uri: &Uri) -> Option<Uri> {
    let scheme = uri.scheme().filter(|scheme| [Scheme::HTTP, Scheme::HTTPS].contains(scheme))?;
    let authority = uri.authority().filter(|of| !of.host().is_empty())?.as_str();
    let server = authority.rsplit_once('@').map_or(authority, |(_, server)| server);
    let rest = uri.path_and_query().map_or("/", |rest| rest.as_str());
    Uri::builder().scheme(scheme.clone()).authority(server).path_and_query(rest).build().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uri(text: &str) -> Uri {
        text.parse().expect("an address")
    }

    #[test]
    fn servers_are_the_same_if_scheme_host_and_port_are() {
        let same = |a: &str, b: &str| is_same_server(&uri(a), &uri(b));
        assert!(same("http://host/a", "http://HOST:80/b?c") && same("https://host:443/", "https://host/x"));
        for other in ["https://host/", "http://host:81/", "http://host.evil/", "http://a.host/", "http://127.0.0.1/"] {
            assert!(!same("http://host/", other), "{other}");
        }
        assert!(!same("https://host/", "https://host:80/") && !same("http://host:443/", "https://host/"));
    }

    #[test]
    fn locations_are_relative_to_the_address_that_answered() {
        let from = uri("https://host:81/a/b/run.wspl?sig=secret");
        for (location, expected) in [
            ("https://other/x y", "https://other/x%20y"),
            ("HTTP://other/x", "http://other/x"),
            ("//other:9/x", "https://other:9/x"),
            ("/x?y#z", "https://host:81/x?y"),
            ("?y=/1:2", "https://host:81/a/b/run.wspl?y=/1:2"),
            ("x", "https://host:81/a/b/x"),
            ("../x/./y?z", "https://host:81/a/x/y?z"),
            ("../../../../x", "https://host:81/x"),
            ("https://me:word@other", "https://other/"),
            ("", "https://host:81/a/b/run.wspl?sig=secret"),
        ] {
            assert_eq!(target(&from, location).expect(location), uri(expected), "{location}");
        }
        for location in ["file:///etc/passwd", "gopher://host/", "s3://bucket/key", "https:///x", "\u{1}", "data:x"] {
            assert_eq!(target(&from, location), None, "{location}");
        }
    }
}
