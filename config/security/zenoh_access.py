"""Rights as the access control of Zenoh, and the files of nodes and routers that go with it.

Every node is a client of a router, which knows it by the name in its certificate: the enclave. The
router passes on what the rights of that enclave allow, and nothing else.
"""

import ipaddress
import json

PORT = 7447
# What rmw_zenoh_cpp sets: paths of a million elements take a message of that length.
MESSAGE_BYTES_MAX = 33554432
QUERY_TIMEOUT_MS = 60000
# Which messages a node may send ("ingress" of the router), and which it may receive.
MESSAGES = {
    "publish": (["put", "delete", "reply"], ["declare_subscriber"]),
    "reply": (["declare_queryable", "reply"], ["query"]),
}
# The same of what a latched topic keeps for late subscribers. A reply has the key of its sample.
MESSAGES_OF_MEMORY = (
    ["put", "declare_queryable", "reply", "liveliness_token"],
    ["declare_subscriber", "query", "liveliness_token", "declare_liveliness_subscriber",
     "liveliness_query"])
# The other side of a right sends what this one receives.
OTHER_SIDE = {"subscribe": "publish", "request": "reply"}


def key(name, end):
    """A name in a policy as a key: domain, name, type and type hash; * stands for any text."""
    parts = name.split("/")
    if parts[-1] == "*":
        parts[-1] = "**"
    else:
        parts += ["*", "*"]
    return "/".join(["*", *(part if part in ("*", "**") else part.replace("*", "$*")
                            for part in parts)]) + end


def rules(enclave, rights):
    """The rules of an enclave: messages, direction and keys."""
    found = []

    def allow(messages, flow, keys):
        found.append({"id": f"{enclave} {len(found)}", "permission": "allow", "flows": [flow],
                      "messages": messages, "key_exprs": keys})

    for right in sorted({right for right, _ in rights}):
        names = [name for is_right, name in rights if is_right == right]
        base = OTHER_SIDE.get(right, right)
        kinds = [(MESSAGES[base], "")]
        if base == "publish":
            kinds.append((MESSAGES_OF_MEMORY, "/@adv/**"))
        for (sent, received), end in kinds:
            if base != right:
                sent, received = received, sent
            keys = [key(name, end) for name in names]
            allow(sent, "ingress", keys)
            allow(received, "egress", keys)
    # The graph: all see it, and a node announces itself and its endpoints under its own enclave.
    everything = ["@ros2_lv/**"]
    own = [f"@ros2_lv/*/*/*/*/*/{enclave.replace('/', '%')}/**"]
    allow(["liveliness_token"], "ingress", own)
    allow(["liveliness_token"], "egress", everything)
    allow(["declare_liveliness_subscriber", "liveliness_query"], "ingress", everything)
    return found


def access_control(rights_by_enclave, routers):
    """The rights of all enclaves. Routers carry everything between each other."""
    policies, subjects, all_rules = [], [], []
    for name, made in [(name, rules(name, rights)) for name, rights in rights_by_enclave.items()]:
        all_rules += made
        subjects.append({"id": name, "cert_common_names": [name]})
        policies.append({"rules": [rule["id"] for rule in made], "subjects": [name]})
    all_rules.append({
        "id": "routers", "permission": "allow", "flows": ["ingress", "egress"],
        "messages": ["put", "delete", "declare_subscriber", "query", "declare_queryable", "reply",
                     "liveliness_token", "declare_liveliness_subscriber", "liveliness_query"],
        "key_exprs": ["**", "**/@adv/**", "@ros2_lv/**"]})
    subjects.append({"id": "routers", "cert_common_names": [name_of(host) for host in routers]})
    policies.append({"rules": ["routers"], "subjects": ["routers"]})
    return {"enabled": True, "default_permission": "deny", "rules": all_rules,
            "subjects": subjects, "policies": policies}


def name_of(host):
    """The name in the certificate of a router."""
    return f"router {host}"


def subject_names(host):
    """The names under which a router is reached."""
    def kind(name):
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return f"DNS:{name}"
        return f"IP:{name}"

    names = dict.fromkeys([host, "localhost", "127.0.0.1", "::1"])
    return ",".join(kind(name) for name in names)


def endpoint(host):
    return f"tls/[{host}]:{PORT}" if ":" in host else f"tls/{host}:{PORT}"


def common(tls):
    return {"scouting": {"multicast": {"enabled": False}},
            "transport": {"link": {"rx": {"max_message_size": MESSAGE_BYTES_MAX},
                                   "tls": {"enable_mtls": True, **tls}}}}


def session(folder):
    """The session of a node whose files are in this folder."""
    return {"mode": "client", "connect": {"endpoints": [endpoint("localhost")]},
            "queries_default_timeout": QUERY_TIMEOUT_MS,
            # Latched topics go by time.
            "timestamping": {"enabled": {"router": True, "peer": True, "client": True}},
            **common({"root_ca_certificate": f"{folder}/identity_ca.cert.pem",
                      "connect_certificate": f"{folder}/cert.pem",
                      "connect_private_key": f"{folder}/key.pem"})}


def router(host, others, folder, access):
    """A router whose files are in this folder. Alone on localhost, it is reached from there only."""
    is_alone = host == "localhost" and not others
    return {"mode": "router",
            "listen": {"endpoints": [endpoint("localhost" if is_alone else "::")]},
            "connect": {"endpoints": [endpoint(other) for other in others]},
            **common({"root_ca_certificate": f"{folder}/ca.cert.pem",
                      **{f"{side}_{what}": f"{folder}/{file}" for side in ("listen", "connect")
                         for what, file in (("certificate", "cert.pem"),
                                            ("private_key", "key.pem"))}}),
            "access_control": access}


def write(path, config):
    path.write_text(json.dumps(config, indent=2) + "\n")
