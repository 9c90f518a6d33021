#!/usr/bin/env python3
"""Makes a keystore in the layout of SROS2 from a policy, with openssl; for DDS and for Zenoh.

    make_keystore.py KEYSTORE                        for nodes without a namespace
    make_keystore.py KEYSTORE --namespace /cell/mill
    make_keystore.py KEYSTORE --policy my_policy.xml --days 30
    make_keystore.py KEYSTORE --router cell-pc --router 10.0.0.2    the hosts that have a router of Zenoh

KEYSTORE/private holds the key of the authority: take it away from the machine, whoever has it can
make enclaves. KEYSTORE/enclaves/NAME holds what a node needs; whoever can read it is that node.
KEYSTORE/routers/HOST is the same for a router, whose rules hold all rights.
Run again with the same KEYSTORE it keeps the authority and makes all enclaves anew.
"""

import argparse
import datetime
import pathlib
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from xml.sax.saxutils import escape

import zenoh_access

HERE = pathlib.Path(__file__).parent
INCLUDE = "{http://www.w3.org/2001/XInclude}include"
SERVICES_OF_ACTION = ["send_goal", "cancel_goal", "get_result"]
TOPICS_OF_ACTION = ["feedback", "status"]
# Every participant announces its endpoints there.
EVERYBODY = "ros_discovery_info"


def openssl(*words, stdin=None):
    done = subprocess.run(["openssl", *map(str, words)], input=stdin, capture_output=True)
    if done.returncode != 0:
        sys.exit(f"openssl {words[0]}: {done.stderr.decode().strip()}")
    return done.stdout


def included(profile, folder):
    """The elements of a profile, with those of the files that it includes."""
    for element in profile:
        if element.tag == INCLUDE:
            yield from included(ElementTree.parse(folder / element.get("href")).getroot(), folder)
        else:
            yield element


def full_name(name, namespace, node):
    """As ROS expands names, without the first slash: DDS puts a prefix in its place."""
    if name.startswith("/"):
        return name[1:]
    if name.startswith("~/"):
        name = f"{node}/{name[2:]}"
    return f"{namespace}/{name}".lstrip("/")


def rights_of(enclave, folder, namespace):
    """What an enclave may do: pairs of `publish`, `subscribe`, `reply` or `request` and a name."""
    rights = set()
    for profile in enclave.iter("profile"):
        if profile.get("node") == "*":
            sys.exit(f"{enclave.get('path')}: a node of any name could answer for every other")
        inside = full_name(profile.get("ns", "/"), "", "") or namespace.strip("/")
        for element in included(profile, folder):
            for right, verdict in element.attrib.items():
                if verdict != "ALLOW":
                    sys.exit(f"{element.tag} {right}={verdict}: only ALLOW is understood here")
                for item in element:
                    name = full_name(item.text.strip(), inside, profile.get("node"))
                    rights.update(single_rights(element.tag, right, name))
    return sorted(rights)


def single_rights(kind, right, name):
    """A right of the policy; those of an action are those of its services and topics."""
    if kind != "actions":
        return {(right, name)}
    service, topic = ("reply", "publish") if right == "execute" else ("request", "subscribe")
    return {(service, f"{name}/_action/{part}") for part in SERVICES_OF_ACTION} | {
        (topic, f"{name}/_action/{part}") for part in TOPICS_OF_ACTION}


def topics_of(rights):
    """The DDS topics of rights: those that are published, those that are subscribed to."""
    publish, subscribe = {EVERYBODY}, {EVERYBODY}
    for right, name in rights:
        if right in ("publish", "subscribe"):
            (publish if right == "publish" else subscribe).add(f"rt/{name}")
        else:
            mine, others = f"rr/{name}Reply", f"rq/{name}Request"
            if right == "request":
                mine, others = others, mine
            publish.add(mine)
            subscribe.add(others)
    return sorted(publish), sorted(subscribe)


def permissions(path, publish, subscribe, days):
    now = datetime.datetime.now(datetime.timezone.utc)
    form = "%Y-%m-%dT%H:%M:%S"

    def rule(kind, topics):
        lines = "".join(f"            <topic>{escape(topic)}</topic>\n" for topic in topics)
        return f"        <{kind}>\n          <topics>\n{lines}          </topics>\n        </{kind}>\n"

    return f"""<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
     xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="{escape(path)}">
      <subject_name>CN={escape(path)}</subject_name>
      <validity>
        <not_before>{(now - datetime.timedelta(days=1)).strftime(form)}</not_before>
        <not_after>{(now + datetime.timedelta(days=days)).strftime(form)}</not_after>
      </validity>
      <allow_rule>
        <domains>
          <id_range>
            <min>0</min>
            <max>232</max>
          </id_range>
        </domains>
{rule("publish", publish)}{rule("subscribe", subscribe)}      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
"""


def make_key(path):
    path.touch(mode=0o600)
    path.write_bytes(openssl("genpkey", "-algorithm", "EC", "-pkeyopt", "ec_paramgen_curve:P-256"))


def make_authority(keystore, days):
    key, certificate = keystore / "private/ca.key.pem", keystore / "public/ca.cert.pem"
    if key.exists() and certificate.exists():
        return key, certificate
    for file in (key, certificate):
        file.parent.mkdir(parents=True, exist_ok=True)
    key.parent.chmod(0o700)
    make_key(key)
    openssl("req", "-x509", "-new", "-key", key, "-out", certificate, "-days", days,
            "-subj", "/CN=kerf_ca")
    return key, certificate


def sign(document, target, key, certificate):
    signed = openssl("smime", "-sign", "-text", "-signer", certificate, "-inkey", key,
                     stdin=document.encode())
    target.write_bytes(signed)


def make_certificate(folder, name, authority, days, extensions=""):
    """A key and a certificate of this name, which connects to others and, with names of hosts, listens."""
    key, certificate = authority
    make_key(folder / "key.pem")
    with tempfile.TemporaryDirectory() as work:
        request, extended = pathlib.Path(work, "request"), pathlib.Path(work, "extensions")
        # A name that begins with / needs its slashes escaped.
        subject = "/CN=" + name.replace("/", "\\/")
        openssl("req", "-new", "-key", folder / "key.pem", "-subj", subject, "-out", request)
        extended.write_text(f"basicConstraints=CA:FALSE\n{extensions}")
        openssl("x509", "-req", "-in", request, "-CA", certificate, "-CAkey", key,
                "-set_serial", int.from_bytes(name.encode()[-8:], "big"), "-days", days,
                "-extfile", extended, "-out", folder / "cert.pem")


def make_enclave(keystore, path, rights, authority, args):
    certificate = authority[1]
    folder = keystore / "enclaves" / path.lstrip("/")
    folder.mkdir(parents=True, exist_ok=True)
    folder.chmod(0o700)
    for name in ("identity_ca.cert.pem", "permissions_ca.cert.pem"):
        shutil.copyfile(certificate, folder / name)
    shutil.copyfile(keystore / "enclaves/governance.p7s", folder / "governance.p7s")
    make_certificate(folder, path, authority, args.days)
    publish, subscribe = topics_of(rights)
    document = permissions(path, publish, subscribe, args.days)
    (folder / "permissions.xml").write_text(document)
    sign(document, folder / "permissions.p7s", *authority)
    zenoh_access.write(folder / "zenoh.json5", zenoh_access.session(args.at / folder.relative_to(keystore)))
    print(f"{path}: publishes {len(publish)} topics, subscribes to {len(subscribe)}")


def make_router(keystore, host, access, authority, args):
    folder = keystore / "routers" / host
    folder.mkdir(parents=True, exist_ok=True)
    folder.chmod(0o700)
    shutil.copyfile(authority[1], folder / "ca.cert.pem")
    make_certificate(folder, zenoh_access.name_of(host), authority, args.days,
                     f"subjectAltName={zenoh_access.subject_names(host)}\n")
    others = [other for other in args.router if other != host]
    zenoh_access.write(folder / "router.json5", zenoh_access.router(
        host, others, args.at / folder.relative_to(keystore), access))
    print(f"router of {host}: {folder / 'router.json5'}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("keystore", type=pathlib.Path)
    parser.add_argument("--policy", type=pathlib.Path, default=HERE / "policy.xml")
    parser.add_argument("--governance", type=pathlib.Path, default=HERE / "governance.xml")
    parser.add_argument("--namespace", default="/", help="of nodes whose profile says ns=\"/\"")
    parser.add_argument("--days", type=int, default=365, help="how long keys are good")
    parser.add_argument("--router", action="append", metavar="HOST",
                        help="a host with a router of Zenoh, as the others reach it; localhost without any")
    parser.add_argument("--at", type=pathlib.Path, metavar="FOLDER",
                        help="where the keystore will be on the hosts, if not here")
    args = parser.parse_args()
    args.router = list(dict.fromkeys(args.router or ["localhost"]))
    args.at = (args.at or args.keystore).absolute()
    if shutil.which("openssl") is None:
        sys.exit("openssl is not installed")

    authority = make_authority(args.keystore, args.days)
    (args.keystore / "enclaves").mkdir(exist_ok=True)
    sign(args.governance.read_text(), args.keystore / "enclaves/governance.p7s", *authority)
    enclaves = {enclave.get("path"): rights_of(enclave, args.policy.parent, args.namespace)
                for enclave in ElementTree.parse(args.policy).getroot().iter("enclave")}
    for path, rights in enclaves.items():
        make_enclave(args.keystore, path, rights, authority, args)
    access = zenoh_access.access_control(enclaves, args.router)
    for host in args.router:
        make_router(args.keystore, host, access, authority, args)


if __name__ == "__main__":
    main()
