//! The API of a server, as a program outside uses it: documented routes only.

use std::io::{Read, Write};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use serde::Serialize;
use serde_json::Value;
use ureq::http::{Response, StatusCode};
use ureq::{Agent, Body};

use super::BadInput;

/// How long one request may take before it is sent again, and a table may stand still before it is
/// given up.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(30);
/// Pause between two tries while a server is away.
const RETRY_PAUSE: Duration = Duration::from_millis(250);

/// A server that may be away for a while.
#[derive(Clone)]
pub(super) struct Client {
    agent: Agent,
    server: String,
    token: Option<String>,
    /// `name=value` of whoever answers, as a browser sends it.
    cookie: Option<String>,
    /// How long a server that answered once may be away.
    patience: Duration,
    timeout: Duration,
    has_answered: bool,
}

impl Client {
    /// A client of `server`, `http://host:port`; nothing is sent yet.
    ///
    /// # Errors
    /// [`BadInput`] for an address that is none.
    pub(super) fn new(server: &str, patience: Duration) -> anyhow::Result<Self> {
        Self::with_timeout(server, patience, REQUEST_TIMEOUT)
    }

    fn with_timeout(server: &str, patience: Duration, timeout: Duration) -> anyhow::Result<Self> {
        let server = server.trim_end_matches('/').to_owned();
        if server.starts_with("https://") {
            let told = format!(
                "{server}: this program speaks plain http to a server; use its http:// address"
            );
            return Err(BadInput(told).into());
        }
        let is_address = server
            .strip_prefix("http://")
            .is_some_and(|rest| !rest.is_empty());
        if !is_address || format!("{server}/").parse::<ureq::http::Uri>().is_err() {
            return Err(BadInput(format!(
                "--server {server} is no address; write http://127.0.0.1:8080"
            ))
            .into());
        }
        let config = Agent::config_builder()
            .timeout_global(Some(timeout))
            .http_status_as_error(false)
            .proxy(None)
            .build();
        Ok(Self {
            agent: config.into(),
            server,
            token: None,
            cookie: None,
            patience,
            timeout,
            has_answered: false,
        })
    }

    /// Sends this bearer token from now on.
    pub(super) fn authorize(&mut self, token: String) {
        self.token = Some(token);
    }

    /// Sends the server's own token from now on: the one that is given, else `STAIR_TOKEN`, else
    /// none.
    pub(super) fn enter(&mut self, token: Option<&str>) {
        let token = token.map(str::to_owned);
        self.token = token.or_else(|| std::env::var("STAIR_TOKEN").ok());
    }

    /// Does `POST path` and sends from now on the cookie that the reply sets, as the browser of a
    /// labeler does who signs in.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub(super) fn sign_in(&mut self, path: &str, body: &impl Serialize) -> anyhow::Result<()> {
        let response = self.send(path, |client, url| {
            client.request(client.agent.post(url)).send_json(body)
        })?;
        let cookie = response.headers().get("set-cookie");
        let cookie = cookie.and_then(|cookie| cookie.to_str().ok());
        let cookie = cookie.and_then(|cookie| cookie.split(';').next());
        self.cookie = cookie.map(str::to_owned);
        Ok(())
    }

    /// The JSON body of `GET path`.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub(super) fn get(&mut self, path: &str) -> anyhow::Result<Value> {
        json(self.send(path, |client, url| {
            client.request(client.agent.get(url)).call()
        })?)
    }

    /// Copies the body of `GET path`, byte for byte, as it arrives: however long that takes, as
    /// long as some of it comes.
    ///
    /// # Errors
    /// As [`Client::send`]; a body that breaks off, or an output that cannot be written.
    pub(super) fn download(&mut self, path: &str, to: &mut impl Write) -> anyhow::Result<()> {
        let timeout = Some(self.timeout);
        let mut response = self.send(path, |client, url| {
            let request = client.agent.get(url).config();
            let request = request.timeout_global(None).timeout_connect(timeout);
            let request = request.timeout_recv_response(timeout);
            client
                .request(request.timeout_per_read(timeout).build())
                .call()
        })?;
        let body = response.body_mut().with_config().limit(u64::MAX);
        copy(&mut body.reader(), to, self.timeout)
    }

    /// The JSON body that answers `POST path`.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub(super) fn post(&mut self, path: &str, body: &impl Serialize) -> anyhow::Result<Value> {
        json(self.send(path, |client, url| {
            client.request(client.agent.post(url)).send_json(body)
        })?)
    }

    /// The JSON body that answers `PUT path`.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub(super) fn put(&mut self, path: &str, body: &impl Serialize) -> anyhow::Result<Value> {
        json(self.send(path, |client, url| {
            client.request(client.agent.put(url)).send_json(body)
        })?)
    }

    fn request<B>(&self, request: ureq::RequestBuilder<B>) -> ureq::RequestBuilder<B> {
        let request = match &self.token {
            Some(token) => request.header("authorization", format!("Bearer {token}")),
            None => request,
        };
        match &self.cookie {
            Some(cookie) => request.header("cookie", cookie),
            None => request,
        }
    }

    /// Sends until an answer arrives. Everything that is sent may be sent twice: leases stay the
    /// same, an answer is stored once.
    ///
    /// # Errors
    /// [`BadInput`] when the server cannot be reached at all, does not know the run or refuses the
    /// token; [`Refused`] for every other problem that it reports.
    fn send(
        &mut self,
        path: &str,
        one_try: impl Fn(&Self, &str) -> Result<Response<Body>, ureq::Error>,
    ) -> anyhow::Result<Response<Body>> {
        let url = format!("{}{path}", self.server);
        let gave_up_at = Instant::now() + self.patience;
        loop {
            let failure = match one_try(self, &url) {
                Ok(response) if is_passing(response.status()) => response.status().to_string(),
                Ok(response) => {
                    self.has_answered = true;
                    return refuse(response);
                }
                Err(error) => plain(&error),
            };
            if !self.has_answered {
                let told = format!(
                    "cannot reach {}: {failure}. Is `stair serve` running there?",
                    self.server
                );
                return Err(BadInput(told).into());
            }
            if Instant::now() >= gave_up_at {
                let waited = self.patience.as_secs();
                anyhow::bail!(
                    "{} was away for {waited} s: {failure}. Start this command again later",
                    self.server
                );
            }
            std::thread::sleep(RETRY_PAUSE);
        }
    }
}

/// A server that starts, stops or is overrun: worth another try.
fn is_passing(status: StatusCode) -> bool {
    matches!(
        status,
        StatusCode::SERVICE_UNAVAILABLE | StatusCode::TOO_MANY_REQUESTS | StatusCode::BAD_GATEWAY
    )
}

/// The transport's words without its own name in front.
fn plain(error: &ureq::Error) -> String {
    match error {
        ureq::Error::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

/// A problem that the server reported.
#[derive(Debug)]
pub(super) struct Refused {
    /// HTTP status.
    pub(super) status: u16,
    /// In the server's words.
    pub(super) detail: String,
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the server refused ({}): {}", self.status, self.detail)
    }
}

impl std::error::Error for Refused {}

fn refuse(mut response: Response<Body>) -> anyhow::Result<Response<Body>> {
    let status = response.status();
    if status.is_success() {
        return Ok(response);
    }
    let text = response.body_mut().read_to_string().unwrap_or_default();
    let problem: Value = serde_json::from_str(&text).unwrap_or_default();
    let detail = problem["detail"].as_str().or(problem["title"].as_str());
    let detail = detail.map_or_else(|| status.to_string(), str::to_owned);
    match status {
        StatusCode::NOT_FOUND | StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN => {
            Err(BadInput(detail).into())
        }
        _ => Err(Refused {
            status: status.as_u16(),
            detail,
        }
        .into()),
    }
}

fn json(mut response: Response<Body>) -> anyhow::Result<Value> {
    response
        .body_mut()
        .with_config()
        .limit(u64::MAX)
        .read_json()
        .map_err(|error| {
            BadInput(format!(
                "the server's answer is no JSON ({error}); is it a STAIR server?"
            ))
            .into()
        })
}

/// Copies a table to its end.
///
/// * `timeout` – how long it may stand still
fn copy(from: &mut impl Read, to: &mut impl Write, timeout: Duration) -> anyhow::Result<()> {
    let mut buffer = vec![0; 64 * 1024];
    let mut n_bytes = 0;
    loop {
        let n = match from.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(n) => n,
            Err(error) => {
                let cause = error.get_ref();
                let why = match cause.and_then(|cause| cause.downcast_ref::<ureq::Error>()) {
                    Some(ureq::Error::Timeout(_)) => format!("nothing came for {timeout:?}"),
                    _ => error.to_string(),
                };
                anyhow::bail!("the table broke off after {n_bytes} bytes: {why}; try again");
            }
        };
        to.write_all(&buffer[..n])
            .context("cannot write the table")?;
        n_bytes += n;
    }
}

/// An id becomes part of an address, so it must not be more than one part of it.
///
/// # Errors
/// [`BadInput`] for anything else.
pub(super) fn path_segment(id: &str) -> anyhow::Result<&str> {
    let is_plain = !id.is_empty()
        && id
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
    if is_plain {
        Ok(id)
    } else {
        Err(BadInput(format!("'{id}' is no id")).into())
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead as _, BufReader};
    use std::net::TcpListener;

    use super::*;

    const TIMEOUT: Duration = Duration::from_secs(1);

    /// A server that answers one request with a table of a hundred bytes: ten of them at a time,
    /// `pause` after each, and no more than `n_parts` times. Its address.
    fn table(n_parts: u32, pause: Duration) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let request = BufReader::new(&stream).lines().map_while(Result::ok);
            request.take_while(|line| !line.is_empty()).for_each(drop);
            write!(stream, "HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\n").unwrap();
            for _ in 0..n_parts {
                stream.write_all(b"0123456789").unwrap();
                std::thread::sleep(pause); // how slowly it comes is the point
            }
        });
        format!("http://{address}")
    }

    fn download(server: &str) -> anyhow::Result<Vec<u8>> {
        let mut client = Client::with_timeout(server, Duration::ZERO, TIMEOUT)?;
        let mut bytes = Vec::new();
        client.download("/table", &mut bytes)?;
        Ok(bytes)
    }

    #[test]
    fn a_table_may_take_longer_than_a_request_while_some_of_it_comes() {
        let bytes = download(&table(10, TIMEOUT / 5)).unwrap();
        assert_eq!(bytes.len(), 100);
    }

    #[test]
    fn a_table_that_breaks_off_is_told_with_how_much_came() {
        let told = download(&table(3, Duration::ZERO)).unwrap_err();
        let told = told.to_string();
        assert!(
            told.starts_with("the table broke off after 30 bytes: "),
            "{told}"
        );
        assert!(told.ends_with("; try again"), "{told}");
    }

    #[test]
    fn a_table_that_stands_still_is_given_up() {
        let told = download(&table(1, 10 * TIMEOUT)).unwrap_err();
        let expected = "the table broke off after 10 bytes: nothing came for 1s; try again";
        assert_eq!(told.to_string(), expected);
    }

    #[test]
    fn an_id_that_would_change_the_address_is_refused() {
        assert!(path_segment("9f3c-1").is_ok());
        for bad in ["", "../leases", "a b", "x?y"] {
            assert!(path_segment(bad).is_err(), "{bad}");
        }
    }
}
