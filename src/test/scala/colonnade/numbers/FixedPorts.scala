package colonnade.numbers

import chisel3._
import chiseltest._

/** Raw integers for ports of type [[Fixed]]. */
object FixedPorts {
  implicit final class FixedPort(port: Fixed) {
    def pokeRaw(raw: BigInt): Unit = port.raw match {
      case signed: SInt   => signed.poke(raw)
      case unsigned: UInt => unsigned.poke(raw)
      case other          => throw new IllegalArgumentException(s"$other is no raw number")
    }

    def peekRaw(): BigInt = port.raw.peek().litValue
  }
}
