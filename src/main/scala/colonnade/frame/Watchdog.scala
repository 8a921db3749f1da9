package colonnade.frame

import chisel3._

final class WatchdogIO(bits: Int) extends Bundle {

  /** Cycles without progress until it expires; 0 disables it. */
  val limit = Input(UInt(bits.W))

  val restart = Input(Bool()) // resets the count
  val hold    = Input(Bool()) // do not count this cycle

  val isExpired = Output(Bool())
}

/** Counts the cycles since the last progress; expires in the cycle after `limit` of them. */
final class Watchdog(bits: Int) extends Module {
  val io = IO(new WatchdogIO(bits))

  private val count = RegInit(0.U(bits.W))
  io.isExpired := io.limit =/= 0.U && count === io.limit

  when(io.restart) {
    count := 0.U
  }.elsewhen(!io.hold && !io.isExpired) {
    count := count + 1.U
  }
}
