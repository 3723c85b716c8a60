//! Movies, which the program ffmpeg makes of the pictures that it is sent.

use super::{Picture, Rendered, SinkConfig};
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{ChildStdin, Command, ExitStatus, Stdio};
use std::sync::PoisonError;
use std::thread::{self, JoinHandle};
use std::time::Duration;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::{Helper, Output};

/// The kinds of movies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MovieFormat {
    /// H.264 in MP4: plays nearly everywhere.
    Mp4,
    /// VP9 in WebM.
    Webm,
    /// An animated GIF with a palette for each picture.
    Gif,
}

/// Pads to even sides, which 4:2:0 needs, and converts to the colours of high-definition television.
const TO_VIDEO: &str = "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv,format=yuv420p";
/// A palette for each picture, so that ffmpeg keeps no more than one.
const TO_GIF: &str = "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=sierra2_4a";
/// Tags that tell players the colour space.
const TAGS: [&str; 6] = ["-color_primaries", "bt709", "-color_trc", "bt709", "-colorspace", "bt709"];

/// How often to look whether ffmpeg has ended.
const WAIT: Duration = Duration::from_millis(5);

/// The longest comment, in letters.
const MOST_COMMENT: usize = 2000;
/// The last bytes of ffmpeg's messages that an error repeats.
const MOST_MESSAGE: usize = 1000;

impl MovieFormat {
    /// The arguments of ffmpeg behind its input.
    fn arguments(self) -> Vec<&'static str> {
        match self {
            Self::Mp4 => {
                let codec = ["-vf", TO_VIDEO, "-c:v", "libx264", "-crf", "18", "-movflags", "+faststart", "-f", "mp4"];
                [&TAGS[..], &codec].concat()
            }
            Self::Webm => {
                let codec =
                    ["-vf", TO_VIDEO, "-c:v", "libvpx-vp9", "-crf", "30", "-b:v", "0", "-row-mt", "1", "-f", "webm"];
                [&TAGS[..], &codec].concat()
            }
            Self::Gif => vec!["-filter_complex", TO_GIF, "-loop", "0", "-f", "gif"],
        }
    }
}

/// A movie in work. If it is dropped, no file remains.
pub(super) struct Movie {
    out: Output,
    ffmpeg: Helper,
    /// Takes the pictures; none once they have ended.
    pictures: Option<ChildStdin>,
    /// Reads ffmpeg's messages, so that it never waits for a reader.
    messages: JoinHandle<String>,
}

impl Movie {
    /// Starts ffmpeg.
    ///
    /// # Errors
    /// Standard output, or a machine without ffmpeg.
    pub(super) fn new(out: Output, format: MovieFormat, config: &SinkConfig) -> Result<Self> {
        let Some(started) = out.start_helper(|part| command(part, format, config).spawn()) else {
            return Err(Error::path(out.path(), "a movie needs a file, in which ffmpeg can move"));
        };
        let helper = started.map_err(|e| not_started(out.path(), e))?;
        let mut ffmpeg = helper.lock().unwrap_or_else(PoisonError::into_inner);
        let (pictures, stderr) = (ffmpeg.stdin.take(), ffmpeg.stderr.take());
        drop(ffmpeg);
        let messages = thread::spawn(move || stderr.map(last_of).unwrap_or_default());
        Ok(Self { out, ffmpeg: helper, pictures, messages })
    }

    /// Sends one picture.
    pub(super) fn picture(
        &mut self,
        config: &SinkConfig,
        rendered: &Rendered<'_>,
        picture: Picture<'_>,
    ) -> io::Result<()> {
        let image = config.image(rendered, picture);
        self.pictures.as_mut().map_or(Ok(()), |pictures| pictures.write_all(image.as_flattened()))
    }

    /// Waits for ffmpeg, and gives the file its final name.
    ///
    /// # Errors
    /// ffmpeg failed, or the file cannot be renamed.
    pub(super) fn finish(mut self) -> Result<()> {
        let ended = self.wait().map_err(|e| Error::io(self.out.path(), "waiting for ffmpeg", e))?;
        if !ended.success() {
            return Err(self.failed());
        }
        self.out.commit()
    }

    /// Waits for ffmpeg to end, but without holding it: a signal must still be able to end it.
    fn wait(&mut self) -> io::Result<ExitStatus> {
        drop(self.pictures.take());
        loop {
            if let Some(ended) = self.ffmpeg.lock().unwrap_or_else(PoisonError::into_inner).try_wait()? {
                return Ok(ended);
            }
            thread::sleep(WAIT);
        }
    }

    /// The error with ffmpeg's own words.
    pub(super) fn failed(mut self) -> Error {
        let _ = self.wait(); // its messages end then
        let said = self.messages.join().unwrap_or_default();
        let said = if said.trim().is_empty() { "it ended early and says nothing".into() } else { said };
        Error::path(self.out.path(), format!("ffmpeg failed: {}", said.trim()))
    }
}

fn command(part: &Path, format: MovieFormat, config: &SinkConfig) -> Command {
    let [width, height] = config.size;
    let mut command = Command::new("ffmpeg");
    command.args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"]);
    command.args(["-s", &format!("{width}x{height}"), "-framerate", &config.fps.to_string(), "-i", "pipe:0"]);
    command.args(["-metadata", &format!("comment={}", comment(config))]);
    command.args(format.arguments()).arg(part);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// The software and the settings, without letters that arguments cannot hold.
fn comment(config: &SinkConfig) -> String {
    let texts = config.texts_of_run().into_iter().map(|(name, text)| format!("{name}={text}"));
    let joined = texts.collect::<Vec<_>>().join("; ");
    joined.chars().filter(|letter| !letter.is_control()).take(MOST_COMMENT).collect()
}

fn not_started(path: &Path, error: io::Error) -> Error {
    if error.kind() == io::ErrorKind::NotFound {
        let how = "install it (apt install ffmpeg, brew install ffmpeg, winget install ffmpeg), or write .apng instead";
        return Error::path(path, format!("movies are made by the program ffmpeg, which is not installed; {how}"));
    }
    Error::io(path, "starting ffmpeg", error)
}

/// The last bytes of a stream.
fn last_of(mut stream: impl Read) -> String {
    let (mut all, mut some) = (Vec::new(), [0; 4096]);
    while let Ok(read) = stream.read(&mut some) {
        if read == 0 {
            break;
        }
        all.extend_from_slice(&some[..read]);
        all.drain(..all.len().saturating_sub(MOST_MESSAGE));
    }
    String::from_utf8_lossy(&all).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_messages_are_kept() {
        assert_eq!(last_of(&b"short"[..]), "short");
        let long = [vec![b'x'; 50_000], b"the end".to_vec()].concat();
        let kept = last_of(&long[..]);
        assert!(kept.len() == MOST_MESSAGE && kept.ends_with("xthe end"));
    }

    #[test]
    fn every_format_names_its_container() {
        for format in [MovieFormat::Mp4, MovieFormat::Webm, MovieFormat::Gif] {
            let arguments = format.arguments();
            assert!(arguments.windows(2).any(|pair| pair[0] == "-f"), "{format:?}: the temporary name has no ending");
        }
    }
}
