"""What a run found, judged: its models beside each other, their images, and which of them a scene needs."""

from gpsearch.judging.contenders import Contender, contenders

__all__ = ["Contender", "contenders"]
