//! A store of generated bags, made once, and a store that fails.

#[path = "../../examples/generate/mod.rs"]
mod generate;

use async_trait::async_trait;
use fleet::core::schema::{INDEX, Row, VERDICTS};
use fleet::dataset;
use fleet::store::Store;
use fleet::table::{Texts, from_parquet};
use fleet::worker::{self, Done, Order};
use futures::stream::BoxStream;
use object_store::path::Path as ObjectPath;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use tempfile::TempDir;

/// Bags that are made; more are by hand, see docs/fleet.md.
pub(crate) const COUNT: u64 = 200;

/// A folder with the bags.
pub(crate) fn bags() -> Vec<PathBuf> {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        for number in 0..COUNT {
            let bag = generate::bag(&generate::Spec::new(number));
            fs::write(folder.path().join(format!("{number}.mcap")), bag).expect("written");
        }
        folder
    });
    (0..COUNT).map(|number| folder.path().join(format!("{number}.mcap"))).collect()
}

/// A file of the repository.
pub(crate) fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

pub(crate) fn open(folder: &Path) -> Store {
    Store::create(&folder.display().to_string()).expect("a store")
}

/// Replays a shard in this process.
pub(crate) fn replay(
    store: &Store,
    shard: &str,
    build: &str,
    journal: &Path,
) -> fleet_result::Of<Done> {
    let order = Order {
        shard: shard.parse().expect("a shard"),
        condition: None,
        build,
        journal,
        bag_bytes_max: 64 << 20,
    };
    worker::run(store, &order, &|_| {})
}

pub(crate) mod fleet_result {
    //! The result of what the crate does.
    pub(crate) type Of<T> = Result<T, fleet::FleetError>;
}

/// What the verdicts of a build say, by bag, without times; each file is read for itself, so that a
/// verdict that is there twice is seen.
pub(crate) fn said(store: &Store, build: &str) -> BTreeMap<String, Vec<Row>> {
    let names: Vec<&str> = VERDICTS.iter().map(|(name, ..)| *name).collect();
    let mut said: BTreeMap<String, Vec<Row>> = BTreeMap::new();
    for listed in store.list(&format!("verdicts/build={build}")).expect("a listing") {
        let content = store.get(&listed.object).expect("an object");
        let rows = from_parquet(content, VERDICTS, &names[..12], &mut Texts::default());
        for row in rows.expect("verdicts") {
            said.entry(row[0].to_string()).or_default().push(row);
        }
    }
    said
}

/// The bags of the index.
pub(crate) fn indexed(store: &Store) -> BTreeMap<String, Row> {
    let names: Vec<&str> = INDEX.iter().map(|(name, ..)| *name).collect();
    let read = dataset::index(store, &names).expect("an index");
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    read.rows
}

/// A store that refuses requests: one in `fails_each`, by their number, and writes after `room` bytes.
#[derive(Debug)]
pub(crate) struct Failing {
    pub(crate) inner: Box<dyn ObjectStore>,
    pub(crate) fails_each: u64,
    pub(crate) room: AtomicU64,
    pub(crate) requests: AtomicU64,
}

impl Failing {
    pub(crate) fn new(folder: &Path, fails_each: u64, room: u64) -> Self {
        let inner =
            object_store::local::LocalFileSystem::new_with_prefix(folder).expect("a folder");
        let (room, requests) = (AtomicU64::new(room), AtomicU64::new(0));
        Self { inner: Box::new(inner), fails_each, room, requests }
    }

    fn count(&self) -> Result<()> {
        let number = self.requests.fetch_add(1, Ordering::Relaxed) + 1;
        // Multiplied, so that the requests that fail are not evenly spaced.
        if number.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32 < (1 << 32) / self.fails_each {
            return Err(failure("503 Slow Down"));
        }
        Ok(())
    }
}

fn failure(why: &str) -> Error {
    Error::Generic { store: "failing", source: why.into() }
}

impl fmt::Display for Failing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("failing")
    }
}

#[async_trait]
impl ObjectStore for Failing {
    async fn put_opts(
        &self,
        at: &ObjectPath,
        content: PutPayload,
        options: PutOptions,
    ) -> Result<PutResult> {
        self.count()?;
        let bytes = content.content_length() as u64;
        let took = self
            .room
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |it| it.checked_sub(bytes));
        took.map_err(|_| failure("no space left on device"))?;
        self.inner.put_opts(at, content, options).await
    }

    async fn put_multipart_opts(
        &self,
        at: &ObjectPath,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.count()?;
        self.inner.put_multipart_opts(at, options).await
    }

    async fn get_opts(&self, at: &ObjectPath, options: GetOptions) -> Result<GetResult> {
        self.count()?;
        self.inner.get_opts(at, options).await
    }

    fn delete_stream(
        &self,
        at: BoxStream<'static, Result<ObjectPath>>,
    ) -> BoxStream<'static, Result<ObjectPath>> {
        self.inner.delete_stream(at)
    }

    fn list(&self, at: Option<&ObjectPath>) -> BoxStream<'static, Result<ObjectMeta>> {
        match self.count() {
            Ok(()) => self.inner.list(at),
            Err(error) => Box::pin(futures::stream::once(async { Err(error) })),
        }
    }

    async fn list_with_delimiter(&self, at: Option<&ObjectPath>) -> Result<ListResult> {
        self.inner.list_with_delimiter(at).await
    }

    async fn copy_opts(
        &self,
        from: &ObjectPath,
        to: &ObjectPath,
        options: CopyOptions,
    ) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }
}
