//! A rerun viewer that is sent a recording while it shows it.
//!
//! The SDK sends in threads of its own, so that a viewer that is slow, not there or gone never holds
//! up the work whose results it shows. Only a stream that ends waits for it: here not for long.

use std::any::Any;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

pub use re_sdk::external::re_uri::ProxyUri as Address;
use re_sdk::sink::{GrpcSink, GrpcSinkConnectionState as State};
use re_sdk::{RecordingStream, RecordingStreamResult};

use super::new_stream;

/// Where a viewer on this machine listens.
pub const DEFAULT_URL: &str = re_sdk::DEFAULT_CONNECT_URL;
/// The port of [`DEFAULT_URL`].
pub const DEFAULT_PORT: u16 = re_sdk::DEFAULT_SERVER_PORT;

/// How long a viewer may take to answer.
const ANSWER: Duration = Duration::from_secs(15);
/// How long it may take to receive what is left once the work is done.
const REST: Duration = Duration::from_secs(10);
/// How often a connection is looked at.
const GLANCE: Duration = Duration::from_millis(50);

/// A viewer's address.
///
/// # Errors
/// It is none, in words.
pub fn address(text: &str) -> Result<Address, String> {
    text.parse().map_err(|_| {
        format!("{text:?} is not the address of a rerun viewer, such as {DEFAULT_URL}")
    })
}

/// Whether something listens at an address, or why not.
pub fn probe(address: &Address) -> std::io::Result<()> {
    let host = address.origin.host.to_string();
    let host = host.trim_start_matches('[').trim_end_matches(']');
    let mut outcome = Err(std::io::Error::other("there is no such host"));
    for place in (host, address.origin.port).to_socket_addrs()? {
        outcome = TcpStream::connect_timeout(&place, Duration::from_secs(2)).map(|_| ());
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}

/// A connection to a viewer.
#[derive(Debug)]
pub struct Viewer {
    address: Address,
    start: Instant,
    stream: RecordingStream,
}

impl Viewer {
    /// Begins to connect to a viewer, which may be about to start.
    pub fn connect(address: &Address) -> RecordingStreamResult<Self> {
        Ok(Self {
            address: address.clone(),
            start: Instant::now(),
            stream: new_stream().connect_grpc_opts(address.to_string())?,
        })
    }

    /// Where to log what it is to show.
    pub fn stream(&self) -> &RecordingStream {
        &self.stream
    }

    /// How the connection is, unless the stream has its hands full.
    fn state(&self) -> Option<State> {
        let (outbox, state) = channel();
        self.stream.inspect_sink(move |sink| {
            let sink = (sink as &dyn Any).downcast_ref();
            // Nobody waits for an answer that comes late.
            let _ = outbox.send(sink.map(GrpcSink::status));
        });
        state.recv_timeout(GLANCE).ok().flatten()
    }

    /// That the viewer is gone, if it is.
    pub fn lost(&self) -> Option<String> {
        matches!(self.state(), Some(State::Disconnected(_)))
            .then(|| format!("the rerun viewer at {} has gone away", self.address))
    }

    /// Waits, not for long, until the viewer has got all. Returns why it has not.
    pub fn finish(self) -> Option<String> {
        let wait = ANSWER.saturating_sub(self.start.elapsed()) + REST;
        let address = self.address.clone();
        let (outbox, outcome) = channel();
        thread::spawn(move || {
            let sent = self.send_rest();
            if sent.is_ok() {
                // A stream that ends waits for its viewer, if need be without end.
                drop(self);
            }
            let _ = outbox.send(sent);
        });
        let late = Err("did not take all in time");
        let reason = outcome.recv_timeout(wait).unwrap_or(late).err()?;
        Some(format!("the rerun viewer at {address} {reason}"))
    }

    fn send_rest(&self) -> Result<(), &'static str> {
        // The stream gives up on an answer before a viewer that was just started may have one.
        while matches!(self.state(), Some(State::Connecting { .. }))
            && self.start.elapsed() < ANSWER
        {
            thread::sleep(GLANCE);
        }
        let flushed = self.stream.flush_with_timeout(REST);
        match (self.state(), flushed) {
            (Some(State::Disconnected(_)), _) => Err("has gone away"),
            (_, Ok(())) => Ok(()),
            (Some(State::Connecting { .. }), _) => Err("does not answer"),
            _ => Err("did not take all in time"),
        }
    }
}
