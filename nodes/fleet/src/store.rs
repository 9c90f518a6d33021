//! Objects of a store, each request tried again while the store may only be busy.

#[cfg(feature = "s3")]
mod s3;

use crate::FleetError;
use bytes::Bytes;
use futures::StreamExt;
use object_store::path::Path as ObjectPath;
use object_store::{Error, ObjectStore, ObjectStoreExt, PutPayload, WriteMultipart};
use std::future::Future;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::runtime::Runtime;

/// Tries of one request. With the pauses between them a request is given up after some six seconds.
const TRIES: u32 = 8;
/// The pause after the first try; each further one is twice as long.
const PAUSE: Duration = Duration::from_millis(50);
/// The object that makes a folder a store, and the format that it names.
pub const MARKER: &str = "kerf-fleet.json";
const FORMAT: u64 = 1;
/// An object larger than this is sent in parts.
const PART_BYTES: usize = 8 << 20;

/// A store and the threads that talk to it.
#[derive(Debug)]
pub struct Store {
    inner: Arc<dyn ObjectStore>,
    name: String,
    /// The same for every spelling of the URL.
    place: String,
    runtime: Runtime,
    /// The most that is sent, bytes per second on average.
    pub rate_max: Option<f64>,
}

/// An object in a listing.
#[derive(Debug, Clone)]
pub struct Listed {
    pub object: String,
    pub bytes: u64,
    pub modified: SystemTime,
}

/// Why a request was not answered with what was asked.
#[derive(Debug)]
pub enum Missing {
    /// There is no such object.
    Absent,
    Failed(FleetError),
}

impl Store {
    /// Opens a store by its URL: `file:///srv/bags`, a folder, or `s3://BUCKET/PREFIX`. It must have been made
    /// with `create`: a mount point whose share is not mounted is no store, and no empty one.
    pub fn open(url: &str) -> Result<Self, FleetError> {
        let store = match Place::of(url)? {
            Place::Folder(folder) => Self::in_folder(url, folder)?,
            Place::S3(place) => Self::in_s3(url, place)?,
        };
        store.check()?;
        Ok(store)
    }

    /// Makes a store, or opens the one that is there. A bucket must be there.
    pub fn create(url: &str) -> Result<Self, FleetError> {
        let store = match Place::of(url)? {
            Place::Folder(folder) => {
                let failed =
                    |why| FleetError::file(folder, format!("the store cannot be made: {why}"));
                std::fs::create_dir_all(folder).map_err(failed)?;
                Self::in_folder(url, folder)?
            }
            Place::S3(place) => Self::in_s3(url, place)?,
        };
        store.mark()?;
        Ok(store)
    }

    fn in_folder(url: &str, folder: &Path) -> Result<Self, FleetError> {
        let absent = |why: &dyn std::fmt::Display| FleetError::no_store(url, why);
        let place = folder.canonicalize().map_err(|why| absent(&why))?;
        let files = object_store::local::LocalFileSystem::new_with_prefix(&place);
        // What is in the store is there after a power cut, too: its copy in the spool is removed.
        let files = files.map_err(|why| absent(&why))?.with_fsync(true);
        let mut store = Self::with(Arc::new(files), url.to_owned())?;
        store.place = format!("file://{}", place.display());
        Ok(store)
    }

    #[cfg(feature = "s3")]
    fn in_s3(url: &str, place: &str) -> Result<Self, FleetError> {
        let (bucket, place) = s3::bucket(url, place)?;
        let mut store = Self::with(bucket, url.to_owned())?;
        store.place = place;
        Ok(store)
    }

    #[cfg(not(feature = "s3"))]
    fn in_s3(url: &str, _: &str) -> Result<Self, FleetError> {
        Err(FleetError::Usage(format!(
            "--store {url}: this build has no stores with s3://; `cargo install --path nodes/fleet --features s3 \
             --locked` makes one that has them"
        )))
    }

    /// Writes the object that makes a folder a store, unless it is there.
    pub fn mark(&self) -> Result<(), FleetError> {
        if !self.has(MARKER)? {
            let content = serde_json::json!({ "kerf_fleet": FORMAT }).to_string();
            self.put(MARKER, &Bytes::from(content))?;
        }
        self.check()
    }

    /// Whether the store is there: a share may have been unmounted since.
    pub fn check(&self) -> Result<(), FleetError> {
        let content = match self.get(MARKER) {
            Ok(content) => content,
            Err(Missing::Absent) => {
                return Err(FleetError::no_store(&self.name, &format!("no {MARKER} is in it")));
            }
            Err(Missing::Failed(error @ FleetError::Denied { .. })) => return Err(error),
            Err(Missing::Failed(error)) => {
                return Err(FleetError::no_store(&self.name, &error));
            }
        };
        let said: serde_json::Value = serde_json::from_slice(&content).unwrap_or_default();
        let usage =
            |why: String| FleetError::Usage(format!("--store {}: {MARKER} {why}", self.name));
        match said["kerf_fleet"].as_u64() {
            Some(version) if version <= FORMAT => Ok(()),
            Some(version) => Err(usage(format!(
                "has format {version}, and this build knows up to {FORMAT}; use a newer kerf-fleet"
            ))),
            None => Err(usage(format!(
                "does not name a format; write {{\"kerf_fleet\": {FORMAT}}} into it if this is a store"
            ))),
        }
    }

    /// A store that is open already.
    pub fn with(inner: Arc<dyn ObjectStore>, name: String) -> Result<Self, FleetError> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            // Reads of files; one is under way at a time.
            .max_blocking_threads(4)
            .build()
            .map_err(|why| FleetError::NotDone(format!("no thread for the store: {why}")))?;
        Ok(Self { inner, place: name.clone(), name, runtime, rate_max: None })
    }

    /// The URL, for people.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where the store is, the same for every spelling of its URL.
    pub fn place(&self) -> &str {
        &self.place
    }

    /// Reads an object whole.
    pub fn get(&self, object: &str) -> Result<Bytes, Missing> {
        let path = ObjectPath::from(object);
        self.tried(object, || async { self.inner.get(&path).await?.bytes().await })
    }

    /// Whether an object is there.
    pub fn has(&self, object: &str) -> Result<bool, FleetError> {
        Ok(self.size(object)?.is_some())
    }

    /// The bytes of an object, if it is there.
    pub fn size(&self, object: &str) -> Result<Option<u64>, FleetError> {
        let path = ObjectPath::from(object);
        match self.tried(object, || self.inner.head(&path)) {
            Ok(object) => Ok(Some(object.size)),
            Err(Missing::Absent) => Ok(None),
            Err(Missing::Failed(error)) => Err(error),
        }
    }

    /// Writes an object; it is there whole or not at all. What was there is replaced.
    pub fn put(&self, object: &str, content: &Bytes) -> Result<(), FleetError> {
        let path = ObjectPath::from(object);
        let put = || async {
            if content.len() <= PART_BYTES {
                self.inner.put(&path, PutPayload::from(content.clone())).await?;
                self.pause_after(content.len()).await;
                return Ok(());
            }
            let upload = self.inner.put_multipart(&path).await?;
            let mut parts = WriteMultipart::new_with_chunk_size(upload, PART_BYTES);
            for at in (0..content.len()).step_by(PART_BYTES) {
                parts.wait_for_capacity(1).await?;
                let part = content.slice(at..content.len().min(at + PART_BYTES));
                let size = part.len();
                parts.put(part);
                self.pause_after(size).await;
            }
            parts.finish().await.map(|_| ())
        };
        self.tried(object, put).map_err(|missing| match missing {
            Missing::Failed(error) => error,
            Missing::Absent => self.failed(object, &"the store has no such place"),
        })
    }

    /// Removes an object, if it is there.
    pub fn remove(&self, object: &str) -> Result<(), FleetError> {
        let path = ObjectPath::from(object);
        match self.tried(object, || self.inner.delete(&path)) {
            Ok(()) | Err(Missing::Absent) => Ok(()),
            Err(Missing::Failed(error)) => Err(error),
        }
    }

    /// Every object in a folder and below, by name.
    pub fn list(&self, folder: &str) -> Result<Vec<Listed>, FleetError> {
        let path = ObjectPath::from(folder);
        let list = || async {
            let mut listing = self.inner.list(Some(&path));
            let mut found = Vec::new();
            while let Some(object) = listing.next().await {
                let object = object?;
                let modified = SystemTime::from(object.last_modified);
                found.push(Listed {
                    object: object.location.to_string(),
                    bytes: object.size,
                    modified,
                });
            }
            Ok(found)
        };
        let mut found = match self.tried(folder, list) {
            Ok(found) => found,
            Err(Missing::Absent) => Vec::new(),
            Err(Missing::Failed(error)) => return Err(error),
        };
        found.sort_by(|one, other| one.object.cmp(&other.object));
        Ok(found)
    }

    fn tried<T, F: Future<Output = object_store::Result<T>>>(
        &self,
        object: &str,
        request: impl Fn() -> F,
    ) -> Result<T, Missing> {
        let mut pause = PAUSE;
        for tries in 1.. {
            let error = match self.runtime.block_on(request()) {
                Ok(answer) => return Ok(answer),
                Err(Error::NotFound { .. }) => return Err(Missing::Absent),
                Err(error) => error,
            };
            if is_final(&error) || tries == TRIES {
                return Err(Missing::Failed(self.refused(object, &error)));
            }
            std::thread::sleep(pause);
            pause *= 2;
        }
        unreachable!("the last try returns")
    }

    /// As long as so many bytes take at the rate that is allowed.
    async fn pause_after(&self, bytes: usize) {
        if let Some(rate) = self.rate_max {
            tokio::time::sleep(Duration::from_secs_f64(bytes as f64 / rate)).await;
        }
    }

    fn refused(&self, object: &str, error: &Error) -> FleetError {
        match error {
            Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => FleetError::Denied {
                store: self.name.clone(),
                object: object.to_owned(),
                why: code_of(&error.to_string()),
            },
            error => self.failed(object, &code_of(&error.to_string())),
        }
    }

    fn failed(&self, object: &str, why: &dyn std::fmt::Display) -> FleetError {
        FleetError::Object {
            store: self.name.clone(),
            object: object.to_owned(),
            why: why.to_string(),
        }
    }
}

/// What a URL names.
enum Place<'a> {
    Folder(&'a Path),
    /// `BUCKET/PREFIX`.
    S3(&'a str),
}

impl<'a> Place<'a> {
    fn of(url: &'a str) -> Result<Self, FleetError> {
        let usage = |why: String| Err(FleetError::Usage(format!("--store {url}: {why}")));
        match url.split_once("://") {
            Some(("file", path)) if path.starts_with('/') => Ok(Self::Folder(Path::new(path))),
            Some(("file", path)) => {
                usage(format!("`{path}` is a host; a folder is file:///{path}"))
            }
            Some(("s3", place)) => Ok(Self::S3(place)),
            Some((scheme, _)) => usage(format!(
                "there are no stores with {scheme}://; use a folder, file:///FOLDER or s3://BUCKET/PREFIX"
            )),
            // A forgotten slash would make a folder of this name.
            None => match url.split_once(':') {
                Some((scheme, _)) if !scheme.contains('/') => usage(format!(
                    "`{scheme}:` begins a URL; a folder is file:///FOLDER, and one of this name is ./{url}"
                )),
                _ => Ok(Self::Folder(Path::new(url))),
            },
        }
    }
}

/// What a server says without its XML, which may repeat the key that it refuses.
fn code_of(text: &str) -> String {
    let Some((before, xml)) = text.split_once("<?xml") else { return text.to_owned() };
    let code = xml.split_once("<Code>").and_then(|(_, rest)| rest.split_once("</Code>"));
    format!("{}{}", before, code.map_or("", |(code, _)| code))
}

/// Whether another try has the same answer.
fn is_final(error: &Error) -> bool {
    !matches!(error, Error::Generic { .. } | Error::JoinError { .. })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_store_is_refused_with_what_is_one() {
        for (url, expected) in [
            ("gopher://x", "--store gopher://x: there are no stores with gopher://".to_owned()),
            (
                "file://srv/bags",
                "--store file://srv/bags: `srv/bags` is a host; a folder is file:///srv/bags"
                    .to_owned(),
            ),
            (
                "file:/srv/x",
                "--store file:/srv/x: `file:` begins a URL; a folder is file:///FOLDER".to_owned(),
            ),
        ] {
            for error in [Store::open(url), Store::create(url)] {
                let error = error.expect_err(url);
                assert!(error.to_string().starts_with(&expected), "{error}");
                assert_eq!(error.status(), 2);
            }
        }
        assert!(!Path::new("file:").exists());
    }

    #[test]
    fn what_a_server_says_is_cut_down_to_its_code() {
        for (text, expected) in [
            ("no route to host", "no route to host"),
            (
                "403 Forbidden: <?xml version=\"1.0\"?><Error><Code>SignatureDoesNotMatch</Code><AWSAccessKeyId>AKIA\
              </AWSAccessKeyId></Error>",
                "403 Forbidden: SignatureDoesNotMatch",
            ),
            ("500: <?xml", "500: "),
        ] {
            assert_eq!(code_of(text), expected);
        }
    }

    #[test]
    fn a_store_is_one_that_was_made() {
        let folder = tempfile::tempdir().expect("a folder");
        let bare = folder.path().display().to_string();
        let none = folder.path().join("none").display().to_string();
        for (url, why) in [(&none, "No such file"), (&bare, "no kerf-fleet.json is in it")] {
            let error = Store::open(url).expect_err("no store");
            let text = error.to_string();
            assert!(
                text.starts_with(&format!("{url}: the store does not answer: {why}")),
                "{text}"
            );
            assert!(text.contains("`kerf fleet push --create` makes one"), "{text}");
            assert_eq!(error.status(), 1);
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
        let made = Store::create(&bare).expect("made");
        Store::create(&bare).expect("opened");
        let marker = folder.path().join(MARKER);
        assert_eq!(std::fs::read(&marker).expect("a file"), br#"{"kerf_fleet":1}"#);
        // Every spelling is one place.
        for url in [format!("file://{bare}"), format!("{bare}/./")] {
            assert_eq!(Store::open(&url).expect("a store").place(), made.place());
        }
        for (content, why) in [
            (r#"{"kerf_fleet": 2}"#, "kerf-fleet.json has format 2, and this build knows up to 1"),
            ("", "kerf-fleet.json does not name a format"),
        ] {
            std::fs::write(&marker, content).expect("written");
            let error = Store::open(&bare).expect_err("of another format");
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.status(), 2);
        }
        std::fs::remove_file(marker).expect("removed");
        assert!(matches!(made.check(), Err(FleetError::NoStore { .. })), "it went away");
    }

    #[test]
    fn an_object_comes_back_and_one_that_is_not_there_is_absent() {
        let folder = tempfile::tempdir().expect("a folder");
        let url = format!("file://{}/made", folder.path().display());
        let store = Store::create(&url).expect("a store");
        let large = Bytes::from(vec![7; PART_BYTES * 2 + 1]);
        for (object, content) in [("a/small", Bytes::from_static(b"1")), ("a/b/large", large)] {
            assert!(!store.has(object).expect("an answer"));
            store.put(object, &content).expect("written");
            assert_eq!(store.get(object).expect("read"), content);
            assert!(store.has(object).expect("an answer"));
        }
        assert!(matches!(store.get("a/none"), Err(Missing::Absent)));
        let listed: Vec<String> =
            store.list("a").expect("a listing").into_iter().map(|it| it.object).collect();
        assert_eq!(listed, ["a/b/large", "a/small"]);
        assert!(store.list("nothing").expect("a listing").is_empty());
    }
}
