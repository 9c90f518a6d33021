//! Stores in a bucket, with what the environment says of it: the variables that the tools of S3 read.

use crate::FleetError;
use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::prefix::PrefixStore;
use object_store::{ClientConfigKey, ObjectStore, RetryConfig};
use std::sync::Arc;

/// Where credentials can come from. Without any of them object_store asks the address at which some clouds
/// answer their own hosts, and waits long where nothing is.
const CREDENTIALS: [&str; 6] = [
    "AWS_ACCESS_KEY_ID",
    "AWS_WEB_IDENTITY_TOKEN_FILE",
    "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
    "AWS_METADATA_ENDPOINT",
    "AWS_SKIP_SIGNATURE",
];

/// A bucket, or a folder in it; and its place, the same for every spelling of the URL.
pub(super) fn bucket(url: &str, place: &str) -> Result<(Arc<dyn ObjectStore>, String), FleetError> {
    let usage = |why: String| FleetError::Usage(format!("--store {url}: {why}"));
    let (bucket, prefix) = place.split_once('/').unwrap_or((place, ""));
    let prefix = prefix.trim_matches('/');
    if bucket.contains('@') {
        // It is not shown: it may be a secret.
        return Err(FleetError::Usage(
            "--store: credentials do not belong into the URL; set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
                .to_owned(),
        ));
    }
    if bucket.is_empty() {
        return Err(usage("no bucket is named; use s3://BUCKET/PREFIX".to_owned()));
    }
    if !CREDENTIALS.iter().any(|name| std::env::var_os(name).is_some_and(|it| !it.is_empty())) {
        return Err(usage(
            "there are no credentials: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY; on a host that has a role, \
             AWS_METADATA_ENDPOINT=http://169.254.169.254"
                .to_owned(),
        ));
    }
    let builder = AmazonS3Builder::from_env()
        .with_bucket_name(bucket)
        // `Store` tries again.
        .with_retry(RetryConfig { max_retries: 0, ..RetryConfig::default() })
        .with_config(AmazonS3ConfigKey::Client(ClientConfigKey::ConnectTimeout), "5s")
        .with_config(AmazonS3ConfigKey::Client(ClientConfigKey::Timeout), "60s");
    let endpoint = builder.get_config_value(&AmazonS3ConfigKey::Endpoint).unwrap_or_default();
    let built = builder.build().map_err(|why| usage(why.to_string()))?;
    let place = format!("{endpoint} s3://{bucket}/{prefix}");
    Ok((Arc::new(PrefixStore::new(built, prefix)), place))
}
