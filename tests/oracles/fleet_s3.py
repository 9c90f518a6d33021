#!/usr/bin/env python3
"""Keeps bags in a store with the interface of S3: moto, from PyPI, in memory on this host.

    fleet_s3.py KERF_FLEET DIFFERENT BAG...

KERF_FLEET is built with the feature `s3`, and `kerf` is beside it. DIFFERENT is a bag that today's build does otherwise;
all others are reproduced.
"""

import logging
import os
import subprocess
import sys
import tempfile
from pathlib import Path

# The first requests need no user; then moto, which reads this when it is imported, refuses keys that it did not
# give out.
os.environ["INITIAL_NO_AUTH_ACTION_COUNT"] = "4"

import boto3
from moto.server import ThreadedMotoServer

URL = "s3://bags/shop"


def main() -> None:
    program, different, *bags = sys.argv[1:]
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    endpoint = f"http://{host}:{port}"
    setup = {"aws_access_key_id": "none", "aws_secret_access_key": "none", "region_name": "us-east-1",
             "endpoint_url": endpoint}
    user = boto3.client("iam", **setup)
    user.create_user(UserName="fleet")
    user.put_user_policy(
        UserName="fleet", PolicyName="all",
        PolicyDocument='{"Version": "2012-10-17", "Statement": [{"Effect": "Allow", "Action": "s3:*", "Resource": "*"}]}')
    key = user.create_access_key(UserName="fleet")["AccessKey"]
    boto3.client("s3", **setup).create_bucket(Bucket="bags")
    given = {"AWS_ACCESS_KEY_ID": key["AccessKeyId"], "AWS_SECRET_ACCESS_KEY": key["SecretAccessKey"],
             "AWS_REGION": "us-east-1", "AWS_ENDPOINT": endpoint, "AWS_ALLOW_HTTP": "true"}
    # What the host's own tools of S3 are set to is not meant.
    clean = {name: value for name, value in os.environ.items() if not name.startswith("AWS_")}

    def fleet(*words: str, status: int = 0, **changed: str) -> str:
        answer = subprocess.run([program, *words], env=clean | given | changed, capture_output=True, text=True)
        assert answer.returncode == status, (words, answer)
        return answer.stdout + answer.stderr

    def says(text: str, *parts: str) -> None:
        for part in parts:
            assert part in text, f"{part!r} is not in {text!r}"

    store = ("--store", URL)
    with tempfile.TemporaryDirectory() as folder:
        journal, spool = ("--journal", f"{folder}/journal"), ("--spool", f"{folder}/spool")
        # What is not there, and what may not.
        says(fleet("push", bags[0], *store, status=2, AWS_ACCESS_KEY_ID=""), "no credentials: set AWS_ACCESS_KEY_ID")
        wrong = "the store refuses these credentials or this user"
        says(fleet("push", bags[0], *store, status=1, AWS_ACCESS_KEY_ID="AKIAWRONG"), URL, wrong)
        says(fleet("push", bags[0], *store, status=1, AWS_SECRET_ACCESS_KEY="wrong"), URL, wrong)
        says(fleet("push", bags[0], *store, status=1), "no kerf-fleet.json is in it", "--create")
        says(fleet("push", bags[0], "--create", "--store", "s3://none/x", status=1), "s3://none/x: kerf-fleet.json")
        says(fleet("push", bags[0], "--store", "s3:///x", status=2), "no bucket is named")
        # A store that does not answer: the bags wait, and are sent by the next push.
        says(fleet("push", *bags[:2], *store, *spool, AWS_ENDPOINT="http://127.0.0.1:9"), "2 bags wait in")
        says(fleet("push", *bags, *store, *spool, "--create"), f"{len(bags)} bags sent, 2 were there, 0 refused, 0 wait")
        says(fleet("push", *bags, *store), f"0 bags sent, {len(bags)} were there")
        for shard in ("0/2", "1/2"):
            says(fleet("replay", *store, *journal, "--build", "ci", "--shard", shard), "0 known, 0 absent")
        report = fleet("report", *store)
        says(report, f"build ci: {len(bags)} bags", f"  {len(bags)} reproduced, 0 different, 0 cannot be compared, 0 to do")
        # A bag that was lost and one that was damaged there.
        there = boto3.client("s3", endpoint_url=endpoint, region_name="us-east-1", aws_access_key_id=key["AccessKeyId"],
                             aws_secret_access_key=key["SecretAccessKey"])
        names = [it["Key"] for it in there.list_objects_v2(Bucket="bags", Prefix="shop/bags/")["Contents"]]
        assert len(names) == len(bags), names
        there.delete_object(Bucket="bags", Key=names[0])
        there.put_object(Bucket="bags", Key=names[1], Body=b"junk")
        again = fleet("replay", *store, *journal, "--build", "again")
        says(again, "1 absent", Path(names[0]).name)
        says(fleet("report", *store, "--build", "again"), "1 cannot be compared, 1 to do", "the content of the object is not")
        says(fleet("push", *bags, *store), f"2 bags sent, {len(bags) - 2} were there")
        says(fleet("replay", *store, *journal, "--build", "again"), "2 replayed")
        says(fleet("report", *store, "--build", "again"), f"{len(bags)} reproduced, 0 different")
        # The page of what differs.
        says(fleet("push", different, *store), "1 bags sent")
        says(fleet("replay", *store, *journal, "--build", "again"), "1 replayed")
        fleet("report", *store, "--build", "again", "--html", f"{folder}/report.html", "--pages")
        report = Path(f"{folder}/report.html").read_text()
        pages = list(Path(f"{folder}/report.pages").iterdir())
        assert [page.suffix for page in pages] == [".html"], pages
        assert f'<a href="report.pages/{pages[0].name}">' in report, report
        assert "<canvas" in pages[0].read_text()
    server.stop()
    print(f"a store of S3 keeps {len(bags)} bags")


if __name__ == "__main__":
    main()
