//! Addresses of objects, and the requests that they stand for.

use super::profile::Profile;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use rusty_s3::{Bucket, Credentials, S3Action, UrlStyle};
use std::time::Duration;
use ureq::http::Uri;
use wavesplat_core::base::text::percent_decoded;

/// How long a signed request may be under way.
const VALID: Duration = Duration::from_secs(900);

/// Where an object is, and how to request it.
#[derive(Debug)]
pub(super) enum Address {
    Http {
        url: String,
        /// The `Authorization` header, if the address contains a user name.
        authorization: Option<String>,
    },
    S3(Box<S3>),
}

/// An object of a bucket.
#[derive(Debug)]
pub(super) struct S3 {
    bucket: Bucket,
    key: String,
    credentials: Option<Credentials>,
}

impl Address {
    /// Reads an address.
    ///
    /// # Errors
    /// What is wrong with it, or with the settings of S3.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        match text.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case("s3://")) {
            Some(_) => S3::new(&text[5..], Profile::from_environment()?).map(|object| Self::S3(Box::new(object))),
            None => http(text),
        }
    }

    /// The address of a request, signed if it must be.
    pub(super) fn url(&self) -> String {
        match self {
            Self::Http { url, .. } => url.clone(),
            Self::S3(s3) => s3.bucket.get_object(s3.credentials.as_ref(), &s3.key).sign(VALID).into(),
        }
    }

    /// The server, if the address does not say it.
    pub(super) fn server(&self) -> Option<&str> {
        match self {
            Self::Http { .. } => None,
            Self::S3(s3) => s3.bucket.base_url().host_str(),
        }
    }

    pub(super) fn authorization(&self) -> Option<&str> {
        match self {
            Self::Http { authorization, .. } => authorization.as_deref(),
            Self::S3(_) => None,
        }
    }

    /// Whether requests must use HTTPS. Then redirects to plain HTTP are refused.
    pub(super) fn is_encrypted(&self) -> bool {
        self.url().get(..6).is_some_and(|scheme| scheme.eq_ignore_ascii_case("https:"))
    }

    /// What helps if the server does not allow reading.
    pub(super) fn advice(&self) -> &'static str {
        match self {
            Self::Http { .. } => "",
            Self::S3(s3) if s3.credentials.is_none() => {
                "; no credentials were found: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE"
            }
            Self::S3(_) => "; are the credentials and AWS_REGION those of the bucket?",
        }
    }
}

/// An object of a plain server.
fn http(text: &str) -> Result<Address, String> {
    let text = text.split('#').next().unwrap_or_default().replace(' ', "%20");
    let uri: Uri = text.parse().map_err(|e| format!("is no address: {e}"))?;
    let authority = uri.authority().filter(|of| !of.host().is_empty()).ok_or("is no address: it has no host")?;
    let Some((who, host)) = authority.as_str().rsplit_once('@') else {
        return Ok(Address::Http { url: text, authorization: None });
    };
    let url = text.replacen(authority.as_str(), host, 1);
    Ok(Address::Http { url, authorization: Some(format!("Basic {}", STANDARD.encode(percent_decoded(who)))) })
}

impl S3 {
    /// The object at `bucket/key`.
    fn new(place: &str, profile: Profile) -> Result<Self, String> {
        let (bucket, key) = place.split_once('/').unwrap_or((place, ""));
        if bucket.is_empty() || key.is_empty() || key.ends_with('/') {
            return Err("is no address of an object: s3://BUCKET/KEY".into());
        }
        if key.split('/').any(|step| matches!(step, "." | "..")) {
            return Err("its key has steps like '..', which servers take for others".into());
        }
        let region = profile.region.unwrap_or_else(|| "us-east-1".into());
        let amazon = profile.endpoint.is_none();
        let endpoint = profile.endpoint.unwrap_or_else(|| format!("https://s3.{region}.amazonaws.com"));
        // A certificate of Amazon holds for one label before the server's name; other servers seldom know such names.
        let style = if amazon && !bucket.contains('.') { UrlStyle::VirtualHost } else { UrlStyle::Path };
        let server = endpoint.parse().map_err(|e| format!("{endpoint}, the endpoint of S3, is no address: {e}"))?;
        let bucket = Bucket::new(server, style, bucket.to_string(), region).map_err(|e| e.to_string())?;
        let credentials = profile.credentials.map(credentials).transpose()?;
        Ok(Self { bucket, key: key.into(), credentials })
    }
}

fn credentials([key, secret, token]: [Option<String>; 3]) -> Result<Credentials, String> {
    let (Some(key), Some(secret)) = (key, secret) else {
        return Err("the credentials have a key but no secret (AWS_SECRET_ACCESS_KEY)".into());
    };
    Ok(match token {
        Some(token) => Credentials::new_with_token(key, secret, token),
        None => Credentials::new(key, secret),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn url(place: &str, profile: Profile) -> String {
        Address::S3(Box::new(S3::new(place, profile).expect("an address"))).url()
    }

    #[test]
    fn names_and_passwords_go_to_a_header() {
        let address = http("https://me:a%40b@host:81/x%20y?z=1#end").expect("an address");
        assert_eq!(
            (address.url().as_str(), address.authorization()),
            ("https://host:81/x%20y?z=1", Some("Basic bWU6YUBi"))
        );
        assert!(address.is_encrypted() && !http("http://host/a b").expect("an address").is_encrypted());
        assert!(http("https:///run").is_err() && http("https://a\u{7}b/").is_err());
    }

    #[test]
    fn public_objects_of_buckets_have_plain_addresses() {
        let of = |endpoint: Option<&str>| Profile { endpoint: endpoint.map(String::from), ..Profile::default() };
        assert_eq!(url("lab/a b/run.wspl", of(None)), "https://lab.s3.us-east-1.amazonaws.com/a%20b/run.wspl");
        assert_eq!(url("my.lab/run.wspl", of(None)), "https://s3.us-east-1.amazonaws.com/my.lab/run.wspl");
        assert_eq!(url("lab/run.wspl", of(Some("http://localhost:9000"))), "http://localhost:9000/lab/run.wspl");
    }

    #[test]
    fn requests_with_credentials_are_signed() {
        let credentials = Some([Some("KEY".into()), Some("secret".into()), Some("token".into())]);
        let signed = url("lab/run.wspl", Profile { credentials, region: Some("eu-west-1".into()), endpoint: None });
        for part in ["X-Amz-Credential=KEY", "eu-west-1", "X-Amz-Signature=", "X-Amz-Security-Token=token"] {
            assert!(signed.contains(part), "{signed}");
        }
        assert!(!signed.contains("secret"));
    }

    #[test]
    fn addresses_that_name_no_object_are_refused() {
        for place in ["", "lab", "lab/", "/run", "lab/run/", "lab/../other/run", "lab/./run"] {
            assert!(S3::new(place, Profile::default()).is_err(), "{place}");
        }
        let half = Profile { credentials: Some([Some("KEY".into()), None, None]), ..Profile::default() };
        assert!(S3::new("lab/run", half).is_err());
    }
}
