#!/usr/bin/env python3
"""Creates an SROS2 keystore with openssl, for systems without `ros2 security`.

    tools/keystore.py FOLDER --domain 42 /cell/mill                       an enclave with all permissions
    tools/keystore.py FOLDER --domain 42 /cell/watcher:-rt/psec           one without permission for this topic

An existing keystore gets more enclaves, signed by the same authority. FOLDER/private contains the keys of the authority
and must only be readable by the administrator. Topics have their DDS names: prefix rt/ for a topic, rq/ and rr/ for
the request and response topics of a service.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import options

DAYS = 3650
CURVE = "prime256v1"
CA = "sros2CA"
XSI = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation'
SCHEMAS = "http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_"

GOVERNANCE = """<?xml version="1.0" encoding="UTF-8"?>
<dds {xsi}="{schemas}governance.xsd">
  <domain_access_rules><domain_rule>
    <domains><id>{domain}</id></domains>
    <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
    <enable_join_access_control>true</enable_join_access_control>
    <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
    <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
    <rtps_protection_kind>{rtps}</rtps_protection_kind>
    <topic_access_rules><topic_rule>
      <topic_expression>*</topic_expression>
      <enable_discovery_protection>true</enable_discovery_protection>
      <enable_liveliness_protection>true</enable_liveliness_protection>
      <enable_read_access_control>true</enable_read_access_control>
      <enable_write_access_control>true</enable_write_access_control>
      <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
      <data_protection_kind>ENCRYPT</data_protection_kind>
    </topic_rule></topic_access_rules>
  </domain_rule></domain_access_rules>
</dds>
"""

PERMISSIONS = """<?xml version="1.0" encoding="UTF-8"?>
<dds {xsi}="{schemas}permissions.xsd">
  <permissions><grant name="{name}">
    <subject_name>CN={name}</subject_name>
    <validity><not_before>2020-01-01T00:00:00</not_before><not_after>2100-01-01T00:00:00</not_after></validity>
{deny}    <allow_rule>
      <domains><id>{domain}</id></domains>
      <publish><topics><topic>*</topic></topics></publish>
      <subscribe><topics><topic>*</topic></topics></subscribe>
    </allow_rule>
    <default>DENY</default>
  </grant></permissions>
</dds>
"""

DENY = """    <deny_rule>
      <domains><id>{domain}</id></domains>
      <publish><topics>{topics}</topics></publish>
      <subscribe><topics>{topics}</topics></subscribe>
    </deny_rule>
"""


def openssl(*words: object) -> None:
    """Runs openssl; prints its output only on failure."""
    done = subprocess.run(["openssl", *map(str, words)], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"keystore: openssl {words[0]} failed: {done.stderr.strip()}")


class Keystore:
    """Folder with public/, private/ and enclaves/ in the layout of SROS2."""

    def __init__(self, folder: Path, domain: int, rtps: str):
        """Opens the keystore, or creates the authority and the governance of the domain."""
        self.folder, self.domain = folder, domain
        self.public, self.private, self.enclaves = (folder / part for part in ("public", "private", "enclaves"))
        for part in (self.public, self.private, self.enclaves):
            part.mkdir(parents=True, exist_ok=True)
        self.private.chmod(0o700)
        self.certificate, self.key = self.public / "ca.cert.pem", self.private / "ca.key.pem"
        if not self.key.exists():
            self._key(self.key)
            words = ("req", "-x509", "-new", "-key", self.key, "-out", self.certificate)
            openssl(*words, "-days", DAYS, "-sha256", "-subj", f"/CN={CA}")
        governance = GOVERNANCE.format(xsi=XSI, schemas=SCHEMAS, domain=domain, rtps=rtps)
        self._sign(governance, self.enclaves / "governance.p7s")

    def _key(self, path: Path) -> None:
        openssl("genpkey", "-algorithm", "EC", "-pkeyopt", f"ec_paramgen_curve:{CURVE}", "-out", path)
        path.chmod(0o600)

    def _sign(self, text: str, signed: Path) -> None:
        with tempfile.NamedTemporaryFile("w", suffix=".xml") as document:
            document.write(text)
            document.flush()
            words = ("smime", "-sign", "-in", document.name, "-text", "-out", signed)
            openssl(*words, "-signer", self.certificate, "-inkey", self.key)

    def enclave(self, name: str, denied: list[str]) -> Path:
        """Creates the files of an enclave with all permissions except for the topics `denied`."""
        folder = self.enclaves / name.strip("/")
        folder.mkdir(parents=True, exist_ok=True)
        self._key(folder / "key.pem")
        with tempfile.TemporaryDirectory() as scratch:
            request = Path(scratch) / "request.pem"
            subject = "/CN=" + name.replace("/", "\\/")
            openssl("req", "-new", "-key", folder / "key.pem", "-out", request, "-subj", subject)
            words = ("x509", "-req", "-in", request, "-CA", self.certificate, "-CAkey", self.key, "-days", DAYS)
            serial = ("-CAserial", Path(scratch) / "serial", "-CAcreateserial")
            openssl(*words, "-sha256", *serial, "-out", folder / "cert.pem")
        for part in ("identity_ca.cert.pem", "permissions_ca.cert.pem"):
            shutil.copy(self.certificate, folder / part)
        if folder != self.enclaves:  # The enclave / has it already.
            shutil.copy(self.enclaves / "governance.p7s", folder)
        topics = "".join(f"<topic>{topic}</topic>" for topic in denied)
        deny = DENY.format(domain=self.domain, topics=topics) if denied else ""
        grant = PERMISSIONS.format(xsi=XSI, schemas=SCHEMAS, name=name, domain=self.domain, deny=deny)
        self._sign(grant, folder / "permissions.p7s")
        return folder


def main() -> None:
    """Runs the command line."""
    words = options.parser(__doc__)
    words.add_argument("folder", type=Path)
    words.add_argument("--domain", type=options.domain_id, default=0, help="ROS_DOMAIN_ID of the keystore")
    kinds = ("NONE", "SIGN", "ENCRYPT")
    words.add_argument("--rtps", choices=kinds, default="SIGN", help="protection of whole messages")
    words.add_argument("enclaves", nargs="+", metavar="/ENCLAVE[:-TOPIC]...")
    arguments = words.parse_args()
    keystore = Keystore(arguments.folder, arguments.domain, arguments.rtps)
    for enclave in arguments.enclaves:
        name, *denied = enclave.split(":-")
        print(keystore.enclave(name, denied))


if __name__ == "__main__":
    main()
