"""Confirmation that the broker has processed the commands of a connection."""

from nats.aio.client import Client


async def confirm_sent(client: Client) -> None:
    """Wait until the broker has processed all earlier subscriptions and messages of a connection.

    `Client.flush` of nats-py 2 sends its ping before the commands that wait to be sent. When the broker has answered
    that ping, they are sent, and the ping of a second call follows them.

    Raises:
        nats.errors.Error: the connection is lost, or the broker does not answer one of the pings within 10 s.
    """
    await client.flush()
    await client.flush()
