"""A key and its certificate for the processes of one run, by the package `cryptography`."""

from datetime import UTC, datetime

# The certificate dies with the run, which holds the only key; no date ends it. So a clock that is set under the run, or
# that is wrong from the start (1970 where a battery is flat), locks nobody out.
FIRST = datetime(1970, 1, 1, tzinfo=UTC)
LAST = datetime(9999, 12, 31, 23, 59, 59, tzinfo=UTC)  # RFC 5280, 4.1.2.5: of no well-defined end
NAME = "radarsim"


def self_signed() -> tuple[str, str]:
    """A new private key and a certificate for it that is its own authority, both as PEM text.

    Raises ImportError without `cryptography`.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, NAME)])
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(NAME)]), critical=False)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(FIRST)
        .not_valid_after(LAST)
        .sign(key, hashes.SHA256())
    )
    plain = serialization.NoEncryption()
    pem = serialization.Encoding.PEM
    text = key.private_bytes(pem, serialization.PrivateFormat.PKCS8, plain).decode()
    return text, certificate.public_bytes(pem).decode()
