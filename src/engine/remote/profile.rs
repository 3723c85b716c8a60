//! Credentials, region and endpoint of S3, from the environment variables and files that other programs use.

use configparser::ini::Ini;
use std::env;
use std::path::PathBuf;
use wavesplat_core::base::files;

/// Credentials, region and endpoint.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Profile {
    /// Key, secret and, of temporary credentials, a token; none for public objects.
    pub(super) credentials: Option<[Option<String>; 3]>,
    pub(super) region: Option<String>,
    /// The server, if it is not that of Amazon.
    pub(super) endpoint: Option<String>,
}

/// Keys of a profile whose credentials come from a program or a service.
const INDIRECT: [&str; 6] =
    ["credential_process", "sso_session", "sso_start_url", "role_arn", "web_identity_token_file", "credential_source"];

impl Profile {
    /// The profile that the environment names, with its files.
    ///
    /// # Errors
    /// A named profile that is not there, files that are not understood, and profiles whose credentials are elsewhere.
    pub(super) fn from_environment() -> Result<Self, String> {
        let variable = |name: &str| env::var(name).ok().filter(|value| !value.trim().is_empty());
        Self::from_sources(&variable, &|path| String::from_utf8(files::read(&path).ok()?).ok())
    }

    /// As [`Self::from_environment`], from these variables and files.
    fn from_sources(
        variable: &dyn Fn(&str) -> Option<String>,
        file: &dyn Fn(PathBuf) -> Option<String>,
    ) -> Result<Self, String> {
        let home = |name: &str| variable("HOME").map(|home| PathBuf::from(home).join(".aws").join(name));
        let path = |named: &str, name: &str| variable(named).map(PathBuf::from).or_else(|| home(name));
        let credentials = path("AWS_SHARED_CREDENTIALS_FILE", "credentials").and_then(file).unwrap_or_default();
        let config = path("AWS_CONFIG_FILE", "config").and_then(file).unwrap_or_default();
        let named = variable("AWS_PROFILE");
        let stored = Stored::parse([&credentials, &config], named.as_deref())?;
        let first =
            |names: &[&str], key: &str| names.iter().find_map(|name| variable(name)).or_else(|| stored.get(key));
        let of_environment = variable("AWS_ACCESS_KEY_ID")
            .filter(|_| named.is_none())
            .map(|key| [Some(key), variable("AWS_SECRET_ACCESS_KEY"), variable("AWS_SESSION_TOKEN")]);
        Ok(Self {
            credentials: of_environment.map_or_else(|| stored.credentials(), |given| Ok(Some(given)))?,
            region: first(&["AWS_REGION", "AWS_DEFAULT_REGION"], "region"),
            endpoint: first(&["AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL"], "endpoint_url"),
        })
    }
}

/// A profile as files tell of it.
struct Stored {
    name: String,
    /// The parsed files and the section of each.
    sections: [(Ini, String); 2],
}

impl Stored {
    /// A profile of the texts of the files of credentials and of settings; an error if it was `named` but is in neither.
    fn parse([credentials, config]: [&str; 2], named: Option<&str>) -> Result<Self, String> {
        let name = named.unwrap_or("default").to_string();
        let parsed = |text: &str, what: &str| {
            let mut ini = Ini::new_cs();
            ini.set_multiline(true); // values may go on in indented lines
            ini.read(text.into()).map(|_| ini).map_err(|e| format!("the AWS {what} file is not understood: {e}"))
        };
        let in_config = if name == "default" { name.clone() } else { format!("profile {name}") };
        let sections = [(parsed(credentials, "credentials")?, name.clone()), (parsed(config, "config")?, in_config)];
        let exists = |(ini, section): &(Ini, String)| ini.sections().contains(section);
        if named.is_some() && !sections.iter().any(exists) {
            return Err(format!("the profile {name}, which AWS_PROFILE names, is in no AWS file"));
        }
        Ok(Self { name, sections })
    }

    fn get(&self, key: &str) -> Option<String> {
        let values = self.sections.iter().filter_map(|(ini, section)| ini.get(section, key));
        values.map(|value| value.trim().to_string()).find(|value| !value.is_empty())
    }

    fn credentials(&self) -> Result<Option<[Option<String>; 3]>, String> {
        let keys = ["aws_access_key_id", "aws_secret_access_key", "aws_session_token"].map(|key| self.get(key));
        if keys[0].is_some() {
            return Ok(Some(keys));
        }
        match INDIRECT.into_iter().find(|key| self.get(key).is_some()) {
            Some(key) => Err(format!(
                "the profile {name} gets its credentials by {key}, which is not supported; set them as environment variables, \
                 as `aws configure export-credentials` prints them, and unset AWS_PROFILE",
                name = self.name
            )),
            None => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn profile(variables: &[(&str, &str)], credentials: &str, config: &str) -> Result<Profile, String> {
        let all = [("HOME", "/home/me")].into_iter().chain(variables.iter().copied()).collect::<Vec<_>>();
        let variable = |name: &str| all.iter().find(|(known, _)| *known == name).map(|(_, value)| value.to_string());
        Profile::from_sources(&variable, &|path| match path {
            path if path == Path::new("/home/me/.aws/credentials") => Some(credentials.into()),
            path if path == Path::new("/home/me/.aws/config") => Some(config.into()),
            _ => None,
        })
    }

    fn keys(key: &str, secret: &str) -> Option<[Option<String>; 3]> {
        Some([Some(key.into()), Some(secret.into()), None])
    }

    const CREDENTIALS: &str = "[default]\naws_access_key_id = A\naws_secret_access_key=b=/+\n\n[lab]\n\
                               aws_access_key_id = L\naws_secret_access_key = m\n";
    const CONFIG: &str = "# mine\n[default]\nregion = eu-west-1\ns3 =\n  max_concurrent_requests = 3\n[profile lab]\n\
                          region=us-west-2\nendpoint_url = http://localhost:9000\n[profile sso]\nsso_session = x\n";

    #[test]
    fn the_environment_comes_before_files() {
        let variables = [("AWS_ACCESS_KEY_ID", "E"), ("AWS_SECRET_ACCESS_KEY", "f"), ("AWS_REGION", "sa-east-1")];
        let found = profile(&variables, CREDENTIALS, CONFIG).expect("sound");
        assert_eq!((found.credentials, found.region.as_deref()), (keys("E", "f"), Some("sa-east-1")));
    }

    #[test]
    fn files_hold_profiles() {
        let found = profile(&[], CREDENTIALS, CONFIG).expect("sound");
        assert_eq!((found.credentials, found.region.as_deref()), (keys("A", "b=/+"), Some("eu-west-1")));
        let found = profile(&[("AWS_PROFILE", "lab")], CREDENTIALS, CONFIG).expect("sound");
        assert_eq!((found.credentials, found.region.as_deref()), (keys("L", "m"), Some("us-west-2")));
        assert_eq!(found.endpoint.as_deref(), Some("http://localhost:9000"));
    }

    #[test]
    fn without_credentials_objects_must_be_public() {
        assert_eq!(profile(&[], "", "").expect("sound"), Profile::default());
    }

    #[test]
    fn what_is_not_supported_is_said() {
        let lost = profile(&[("AWS_PROFILE", "gone")], CREDENTIALS, CONFIG).expect_err("no such profile");
        assert!(lost.contains("gone"), "{lost}");
        let indirect = profile(&[("AWS_PROFILE", "sso")], CREDENTIALS, CONFIG).expect_err("not supported");
        assert!(indirect.contains("the profile sso gets its credentials by sso_session"), "{indirect}");
    }
}
