//! A server of files to a browser on this machine, for as long as the test lives.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Serves some folders, each below a prefix of the path; the first that has a file wins.
pub struct Server {
    pub address: String,
    /// Paths that were asked for and are not there.
    pub missed: Arc<Mutex<Vec<String>>>,
}

impl Server {
    pub fn new(folders: Vec<(&'static str, PathBuf)>) -> Server {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = format!("http://{}", listener.local_addr().expect("an address"));
        let missed: Arc<Mutex<Vec<String>>> = Arc::default();
        let (folders, own) = (Arc::new(folders), missed.clone());
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (folders, own) = (folders.clone(), own.clone());
                std::thread::spawn(move || answer(&stream, &folders, &own));
            }
        });
        Server { address, missed }
    }
}

fn answer(mut stream: &TcpStream, folders: &[(&str, PathBuf)], missed: &Mutex<Vec<String>>) {
    let mut request = String::new();
    let mut reader = BufReader::new(stream);
    if reader.read_line(&mut request).is_err() {
        return;
    }
    let mut header = String::new();
    while reader.read_line(&mut header).is_ok_and(|length| length > 2) {
        header.clear();
    }
    let path = request.split(' ').nth(1).unwrap_or("/").split('?').next().unwrap_or("/").to_owned();
    let file = |(prefix, folder): &(&str, PathBuf)| fs::read(folder.join(path.strip_prefix(prefix)?)).ok();
    let found = folders.iter().find_map(file);
    if found.is_none() {
        missed.lock().unwrap().push(path.clone());
    }
    let kind = match Path::new(&path).extension().and_then(|extension| extension.to_str()) {
        Some("js") => "text/javascript",
        Some("html") => "text/html",
        Some("json") => "application/json",
        _ => "application/octet-stream",
    };
    let (status, body) = found.map_or(("404 Not Found", Vec::new()), |body| ("200 OK", body));
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    // A browser that has gone away asks for nothing more.
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&body));
}
