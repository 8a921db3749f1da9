package colonnade.memory

import chisel3._
import chisel3.util._
import colonnade.common.TimingSlice
import colonnade.config.ColonnadeConfig
import colonnade.formats.SceneInDram

final class SceneMemoryIO(config: ColonnadeConfig) extends Bundle {
  private val banks = config.columnBvhMemory.banks

  /** The scene's page of 4 KB in DRAM; constant while a frame runs. */
  val page = Input(UInt(SceneInDram.pageBits.W))

  /** By column and bank; by bus and bank. */
  val requests = Vec(config.array.columns, Vec(banks, Flipped(Decoupled(UInt(Lines.lineBits(config).W)))))
  val lines    = Output(Vec(SharedCache.buses(config), Vec(banks, new LineBroadcast(config))))
  val axi      = DramPort(config)

  /** Forgets all lines; only while idle. */
  val invalidate = Input(Bool())
  val isIdle     = Output(Bool())
  val events     = Output(new SceneMemoryEvents(config))
}

/** Events of [[SceneMemory]] in one cycle: lines that are read from DRAM; a read failed. */
final class SceneMemoryEvents(config: ColonnadeConfig) extends Bundle {
  val dramReads = UInt(log2Ceil(config.columnBvhMemory.banks + 1).W)
  val error     = Bool()
}

/** The shared cache, or a [[LineForwarder]] without one, and the DRAM port. A reset of the columns does not reset it:
  * reads that are in flight end, and a column ignores lines that it does not await.
  */
final class SceneMemory(config: ColonnadeConfig) extends Module {
  val io = IO(new SceneMemoryIO(config))

  private val banks = config.columnBvhMemory.banks
  private val base  = io.page ## 0.U(SceneInDram.pageLog.W)

  if (config.columnBvhMemory.cache.get.hasSharedCache) {
    val caches = Seq.fill(banks)(Module(new SharedCache(config)))
    val dram   = Module(new DramReader(config))
    dram.io.base := base
    io.axi :<>= dram.io.axi
    for ((cache, bank) <- caches.zipWithIndex) {
      cache.io.requests.zip(io.requests).foreach { case (request, column) => request :<>= column(bank) }
      dram.io.reads(bank) :<>= cache.io.reads
      cache.io.data :<>= dram.io.lines(bank)
      cache.io.invalidate := io.invalidate
      io.lines.zip(cache.io.lines).foreach { case (bus, lines) => bus(bank) := lines }
    }
    io.isIdle           := TimingSlice.flag(caches.map(_.io.isIdle).reduce(_ && _), atReset = true)
    io.events.dramReads := RegNext(PopCount(dram.io.reads.map(_.fire)))
    io.events.error     := RegNext(dram.io.lines.map(line => line.fire && line.bits.isError).reduce(_ || _), false.B)
  } else {
    val forwarders = Seq.fill(banks)(Module(new LineForwarder(config)))
    io.axi.ar :<>= DramReader.addresses(config, base, forwarders.map(_.io.reads))
    for ((forwarder, bank) <- forwarders.zipWithIndex) {
      forwarder.io.requests.zip(io.requests).foreach { case (request, column) => request :<>= column(bank) }
      forwarder.io.beats.valid := io.axi.r.valid && io.axi.r.bits.id === bank.U
      forwarder.io.beats.bits  := io.axi.r.bits
      io.lines.foreach(bus => bus(bank) := forwarder.io.lines)
    }
    io.axi.r.ready      := forwarders.map(_.io.beats.fire).reduce(_ || _)
    io.isIdle           := TimingSlice.flag(forwarders.map(_.io.isIdle).reduce(_ && _), atReset = true)
    io.events.dramReads := RegNext(PopCount(forwarders.map(_.io.reads.fire)))
    io.events.error     := RegNext(forwarders.map(_.io.error).reduce(_ || _), false.B)
  }
}
