"""The operator's page: one server, one WebSocket, no build step. See docs/groundstation.md.

`groundstation.web.interface` is what a source of messages, a command path and a player of
recordings look like to it; `groundstation.web.server.PageServer` shows them on a page.
"""
