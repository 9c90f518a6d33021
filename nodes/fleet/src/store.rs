//! Objects of a store, each request tried again while the store may only be busy.

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
/// An object larger than this is sent in parts.
const PART_BYTES: usize = 8 << 20;

/// A store and the threads that talk to it.
#[derive(Debug)]
pub struct Store {
    inner: Arc<dyn ObjectStore>,
    name: String,
    runtime: Runtime,
    /// The most that is sent, bytes per second on average.
    pub rate_max: Option<f64>,
}

/// An object in a listing.
#[derive(Debug, Clone)]
pub struct Listed {
    pub object: String,
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
    /// Opens a store by its URL: `file:///srv/bags`, or a folder. `create` makes the folder.
    pub fn open(url: &str, create: bool) -> Result<Self, FleetError> {
        let usage = |why: String| FleetError::Usage(format!("--store {url}: {why}"));
        let folder = match url.split_once("://") {
            None => Path::new(url),
            Some(("file", path)) if path.starts_with('/') => Path::new(path),
            Some(("file", path)) => {
                return Err(usage(format!("`{path}` is a host; a folder is file:///{path}")));
            }
            Some((scheme, _)) => {
                return Err(usage(format!(
                    "this build has no stores with {scheme}://; use a folder or file:///FOLDER"
                )));
            }
        };
        if create {
            std::fs::create_dir_all(folder).map_err(|why| {
                FleetError::file(folder, format!("the store cannot be made: {why}"))
            })?;
        } else if !folder.is_dir() {
            return Err(usage("there is no such folder; `kerf fleet push` makes it".to_owned()));
        }
        let files = object_store::local::LocalFileSystem::new_with_prefix(folder);
        let files = files.map_err(|why| usage(why.to_string()))?;
        Self::with(Arc::new(files), url.to_owned())
    }

    /// A store that is open already.
    pub fn with(inner: Arc<dyn ObjectStore>, name: String) -> Result<Self, FleetError> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            // Reads of files; one is under way at a time.
            .max_blocking_threads(4)
            .build()
            .map_err(|why| FleetError::NotDone(format!("no thread for the store: {why}")))?;
        Ok(Self { inner, name, runtime, rate_max: None })
    }

    /// The URL, for people.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Reads an object whole.
    pub fn get(&self, object: &str) -> Result<Bytes, Missing> {
        let path = ObjectPath::from(object);
        self.tried(object, || async { self.inner.get(&path).await?.bytes().await })
    }

    /// Whether an object is there.
    pub fn has(&self, object: &str) -> Result<bool, FleetError> {
        let path = ObjectPath::from(object);
        match self.tried(object, || self.inner.head(&path)) {
            Ok(_) => Ok(true),
            Err(Missing::Absent) => Ok(false),
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

    /// Every object in a folder and below, by name.
    pub fn list(&self, folder: &str) -> Result<Vec<Listed>, FleetError> {
        let path = ObjectPath::from(folder);
        let list = || async {
            let mut listing = self.inner.list(Some(&path));
            let mut found = Vec::new();
            while let Some(object) = listing.next().await {
                let object = object?;
                let modified = SystemTime::from(object.last_modified);
                found.push(Listed { object: object.location.to_string(), modified });
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
                return Err(Missing::Failed(self.failed(object, &error)));
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

    fn failed(&self, object: &str, why: &dyn std::fmt::Display) -> FleetError {
        FleetError::Object {
            store: self.name.clone(),
            object: object.to_owned(),
            why: why.to_string(),
        }
    }
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
        let folder = tempfile::tempdir().expect("a folder");
        let none = folder.path().join("none").display().to_string();
        for (url, expected) in [
            (
                "gopher://x",
                "--store gopher://x: this build has no stores with gopher://".to_owned(),
            ),
            (
                "file://srv/bags",
                "--store file://srv/bags: `srv/bags` is a host; a folder is file:///srv/bags"
                    .to_owned(),
            ),
            (&none, format!("--store {none}: there is no such folder; `kerf fleet push` makes it")),
        ] {
            let error = Store::open(url, false).expect_err(url);
            assert!(error.to_string().starts_with(&expected), "{error}");
            assert_eq!(error.status(), 2);
        }
    }

    #[test]
    fn an_object_comes_back_and_one_that_is_not_there_is_absent() {
        let folder = tempfile::tempdir().expect("a folder");
        let url = format!("file://{}/made", folder.path().display());
        let store = Store::open(&url, true).expect("a store");
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
