//! A rerun viewer that is sent messages while it shows them.
//!
//! A thread of its own sends, so that a viewer that is slow, not there or gone never holds up the
//! work whose results it shows.

use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use re_grpc_client::write::{Client, ClientConnectionState, Options};
use re_log_types::LogMsg;
use re_uri::ProxyUri;

/// Where a viewer on this machine listens.
pub const DEFAULT_URL: &str = "rerun+http://127.0.0.1:9876/proxy";
/// The port of [`DEFAULT_URL`].
pub const DEFAULT_PORT: u16 = re_uri::DEFAULT_PROXY_PORT;

/// How long a viewer may take to answer.
const ANSWER: Duration = Duration::from_secs(15);
/// How long it may take to receive what is left once the work is done.
const REST: Duration = Duration::from_secs(10);
/// How often a connection is looked at.
const GLANCE: Duration = Duration::from_millis(50);

/// What a viewer is sent.
pub type Messages = Vec<LogMsg>;

/// A viewer's address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address(ProxyUri);

impl std::str::FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let uri = text.parse().map_err(|_| {
            format!("{text:?} is not the address of a rerun viewer, such as {DEFAULT_URL}")
        })?;
        Ok(Self(uri))
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(formatter)
    }
}

impl Address {
    /// Whether something listens there, or why not.
    pub fn probe(&self) -> std::io::Result<()> {
        let origin = &self.0.origin;
        let host = origin.host.to_string();
        let host = host.trim_start_matches('[').trim_end_matches(']');
        let mut outcome = Err(std::io::Error::other("there is no such host"));
        for place in (host, origin.port).to_socket_addrs()? {
            outcome = TcpStream::connect_timeout(&place, Duration::from_secs(2)).map(|_| ());
            if outcome.is_ok() {
                break;
            }
        }
        outcome
    }
}

/// A connection to a viewer.
#[derive(Debug)]
pub struct Viewer {
    address: Address,
    start: Instant,
    messages: Option<Sender<Messages>>,
    /// Why the viewer does not get any more; empty when it has got all.
    outcome: Receiver<Option<String>>,
}

impl Viewer {
    /// Begins to connect to a viewer, which may be about to start.
    pub fn connect(address: &Address) -> Self {
        let (messages, inbox) = channel();
        let (outbox, outcome) = channel();
        let uri = address.0.clone();
        thread::spawn(move || {
            let client = Client::new(uri, Options::default());
            let result = pass_on(&client, &inbox);
            let failed = result.is_err();
            if failed {
                // What is gone is said before the client is closed, which can take its time.
                let _ = outbox.send(result.err());
            }
            drop(client);
            if !failed {
                let _ = outbox.send(None);
            }
        });
        Self {
            address: address.clone(),
            start: Instant::now(),
            messages: Some(messages),
            outcome,
        }
    }

    /// Sends messages, unless the viewer is gone. Returns why it does not get any more, once.
    #[must_use = "nobody else says that the viewer is gone"]
    pub fn send(&mut self, messages: Messages) -> Option<String> {
        let failed = (self.outcome.try_recv().ok().flatten())
            .map(|reason| format!("the rerun viewer at {} {reason}", self.address));
        if failed.is_some() {
            self.messages = None;
        } else if let Some(outbox) = &self.messages {
            // Whoever does not listen has said why, or will.
            let _ = outbox.send(messages);
        }
        failed
    }

    /// Waits, not for long, until the viewer has got all. Returns why it has not, unless that was
    /// said before.
    pub fn finish(mut self) -> Option<String> {
        // Without a sender the thread knows that nothing more comes.
        self.messages.take()?;
        let wait = ANSWER.saturating_sub(self.start.elapsed()).max(REST);
        let reason = match self.outcome.recv_timeout(wait) {
            Ok(reason) => reason?,
            Err(RecvTimeoutError::Timeout) => "did not take all in time".to_owned(),
            Err(RecvTimeoutError::Disconnected) => "does not answer".to_owned(),
        };
        Some(format!("the rerun viewer at {} {reason}", self.address))
    }
}

/// Sends what comes in until nothing more comes.
fn pass_on(client: &Client, inbox: &Receiver<Messages>) -> Result<(), String> {
    let start = Instant::now();
    // The client takes a few messages only before it is connected.
    while matches!(client.status(), ClientConnectionState::Connecting { .. }) {
        if start.elapsed() > ANSWER {
            return Err("does not answer".to_owned());
        }
        thread::sleep(GLANCE);
    }
    loop {
        // A viewer that goes away is noticed between messages too.
        let messages = match inbox.recv_timeout(GLANCE) {
            Ok(messages) => messages,
            Err(RecvTimeoutError::Timeout) => Vec::new(),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        for message in messages {
            client.send_blocking(message);
        }
        check(client)?;
    }
    let flushed = client.flush_blocking(REST);
    check(client)?;
    flushed.map_err(|_| "did not take all in time".to_owned())
}

fn check(client: &Client) -> Result<(), String> {
    match client.status() {
        ClientConnectionState::Disconnected(_) => Err("has gone away".to_owned()),
        _ => Ok(()),
    }
}
