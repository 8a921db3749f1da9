package colonnade.bus

import chisel3._
import chisel3.util.{log2Ceil, Decoupled}
import chiseltest.ChiselScalatestTester
import colonnade.{Proofs, TestConfigs}
import colonnade.axi.{AxiAddress, AxiReadPort, AxiWritePort}
import colonnade.config.{ColonnadeConfig, ShellConfig}
import org.scalatest.flatspec.AnyFlatSpec

/** A guard with a master that does anything, also when it is reset, and a memory that answers at any time. */
class AxiWriteGuardProof(busBytes: Int) extends Module {
  private val guard = Module(new AxiWriteGuard(1, busBytes))

  val inner   = IO(Flipped(new AxiWritePort(1, busBytes)))
  val abandon = IO(Input(Bool()))
  val aw      = IO(Input(Bool()))
  val w       = IO(Input(Bool()))
  val answers = IO(Input(Bool()))
  guard.io.inner :<>= inner
  guard.io.abandon      := abandon
  guard.io.axi.aw.ready := aw
  guard.io.axi.w.ready  := w
  assume(inner.aw.bits.len < 3.U) // bursts that end within the proof

  private val (bursts, _) = AxiRules.writes(guard.io.axi, answers)
  assert(
    !guard.io.isIdle || (bursts === 0.U && !guard.io.axi.aw.valid && !guard.io.axi.w.valid),
    "idle when all is answered"
  )

  // Data are offered soon, even if no address is ever accepted
  private val waits   = RegInit(0.U(2.W))
  private val hasData = inner.w.valid || abandon
  waits := Mux(guard.io.axi.aw.valid && !aw && hasData && !guard.io.axi.w.valid && !w, waits + 1.U, 0.U)
  private val offersNothing = RegInit(true.B) // no beat since the first address
  when(guard.io.axi.w.valid)(offersNothing := false.B)
  assert(!(offersNothing && waits === 3.U), "data do not wait until their address is accepted")

  // While it abandons, nothing enters, and no byte of what follows is written
  private val wasAbandoning = RegNext(abandon && !guard.io.axi.w.valid, false.B)
  assert(!abandon || !(inner.aw.ready || inner.w.ready || inner.b.valid), "nothing enters")
  assert(!(wasAbandoning && guard.io.axi.w.valid) || guard.io.axi.w.bits.strb === 0.U, "no byte is written")
  private val hadBurst = RegNext(bursts =/= 0.U, false.B)
  cover(guard.io.isIdle && hadBurst && abandon)
}

/** The reader's side. */
class AxiReadGuardProof(busBytes: Int) extends Module {
  private val guard = Module(new AxiReadGuard(1, busBytes, 4))

  val inner   = IO(Flipped(new AxiReadPort(1, busBytes)))
  val abandon = IO(Input(Bool()))
  val ar      = IO(Input(Bool()))
  val answers = IO(Input(Bool()))
  guard.io.inner :<>= inner
  guard.io.abandon      := abandon
  guard.io.axi.ar.ready := ar
  private val beats = RegInit(0.U(6.W)) // of bursts of two beats
  assume(inner.ar.bits.len === 1.U)
  guard.io.axi.r.valid     := answers && beats =/= 0.U
  guard.io.axi.r.bits      := 0.U.asTypeOf(guard.io.axi.r.bits)
  guard.io.axi.r.bits.last := beats(0)
  beats                    := beats + (guard.io.axi.ar.fire ## false.B) - guard.io.axi.r.fire
  AxiRules.holds(guard.io.axi.ar, "ar")
  assert(!guard.io.isIdle || (beats === 0.U && !guard.io.axi.ar.valid), "idle when all is answered")
  assert(!abandon || !(inner.ar.ready || inner.r.valid), "nothing enters")
  assert(!abandon || guard.io.axi.r.ready, "data are taken")
  private val hadBurst = RegNext(beats =/= 0.U, false.B)
  cover(guard.io.isIdle && hadBurst && abandon)
}

/** Bursts of any master to any addresses: those that leave the window do not reach the bus, all are answered. */
class AxiWindowProof(busBytes: Int) extends Module {
  private val guarded = Module(new AxiWindow(1, busBytes))

  val window = IO(Input(new AddressWindow))
  val read   = IO(Flipped(new AxiReadPort(1, busBytes)))
  val write  = IO(Flipped(new AxiWritePort(1, busBytes)))
  val ar     = IO(Input(Bool()))
  val aw     = IO(Input(Bool()))
  val w      = IO(Input(Bool()))
  guarded.io.innerRead :<>= read
  guarded.io.innerWrite :<>= write

  // The window holds still, in whole beats
  private val held = RegNext(window)
  assume(!RegNext(true.B, false.B) || (window.base === held.base && window.end === held.end))
  guarded.io.window := window
  assume(window.base(log2Ceil(busBytes) - 1, 0) === 0.U && window.end(log2Ceil(busBytes) - 1, 0) === 0.U)

  private def isInside(burst: AxiAddress): Bool =
    window.contains(burst.addr, (burst.len +& 1.U) << log2Ceil(busBytes))

  // Reads: beyond the module nothing is answered, so all beats are those of refused bursts
  assume(read.ar.bits.len < 3.U && read.ar.bits.addr(log2Ceil(busBytes) - 1, 0) === 0.U)
  guarded.io.read.ar.ready := ar
  guarded.io.read.r.valid  := false.B
  guarded.io.read.r.bits   := DontCare
  guarded.io.readIsIdle    := true.B
  assert(!guarded.io.read.ar.valid || isInside(guarded.io.read.ar.bits), "a read stays in the window")
  private val beats = RegInit(0.U(4.W))
  beats := beats + Mux(read.ar.fire && !guarded.io.read.ar.fire, read.ar.bits.len +& 1.U, 0.U) - read.r.fire
  assert(read.r.valid === (beats =/= 0.U), "a refused read is answered")
  assert(!read.r.valid || read.r.bits.last === (beats === 1.U), "by as many beats as it asks for")

  // Writes: the same
  assume(write.aw.bits.len < 3.U && write.aw.bits.addr(log2Ceil(busBytes) - 1, 0) === 0.U)
  guarded.io.write.aw.ready := aw
  guarded.io.write.w.ready  := w
  guarded.io.write.b.valid  := false.B
  guarded.io.write.b.bits   := DontCare
  guarded.io.writeIsIdle    := true.B
  assert(!guarded.io.write.aw.valid || isInside(guarded.io.write.aw.bits), "a write stays in the window")
  // The master sends the address before the beats, and no other one before the last of them
  private val discards = RegInit(false.B)
  private val writes   = RegInit(false.B)
  private val answers  = RegInit(0.U(2.W))
  private val refused  = write.aw.fire && !guarded.io.write.aw.fire
  private val isLast   = write.w.fire && write.w.bits.last
  assume(!write.w.valid || writes)
  assume(!write.aw.valid || !writes)
  writes   := Mux(writes, !isLast, write.aw.fire)
  discards := Mux(discards, !isLast, refused)
  answers  := answers + (discards && isLast) - write.b.fire
  assert(!guarded.io.write.w.valid || (writes && !discards), "no beat of a refused write passes")
  assert(write.b.valid === (answers =/= 0.U), "a refused write is answered once")
  cover(read.r.fire && read.r.bits.last && write.b.fire)
}

/** Any rows at any place, in a window that holds still: no byte outside is written. */
class BurstWriterProof(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  private val writer = Module(new BurstWriter(config, shell))

  val rows     = IO(Flipped(Decoupled(new TileRow(config))))
  val settings = IO(Input(new FramebufferSettings))
  val drop     = IO(Input(Bool()))
  val aw       = IO(Input(Bool()))
  val w        = IO(Input(Bool()))
  val answers  = IO(Input(Bool()))
  writer.io.rows :<>= rows
  writer.io.settings     := settings
  writer.io.drop         := drop
  writer.io.axi.aw.ready := aw
  writer.io.axi.w.ready  := w

  // As ShellControl has it: settings hold, are aligned and legal
  private val isFirst = RegNext(false.B, true.B)
  private val rowLog  = log2Ceil(config.frame.tileSize).U +& PixelFormat.bytesLog(settings.format)
  private val mask    = ((1.U << rowLog) - 1.U)(7, 0)
  assume(isFirst || settings.asUInt === RegNext(settings.asUInt))
  assume(!((settings.base | settings.stride) & mask).orR && PixelFormat.isLegal(settings.format))
  assume(rows.bits.mask =/= 0.U)

  private val (bursts, address) = AxiRules.writes(writer.io.axi, answers)
  private val lanes = address(settings.base.getWidth - 1, log2Ceil(shell.busBytes)) ## 0.U(log2Ceil(shell.busBytes).W)
  for (lane <- 0 until shell.busBytes) {
    val byte      = lanes + lane.U
    val isWritten = writer.io.axi.w.valid && writer.io.axi.w.bits.strb(lane)
    assert(!isWritten || (byte >= settings.window.base && byte < settings.window.end), "no byte outside the window")
  }
  private val begin = writer.io.axi.aw.bits.addr
  private val end   = begin +& (1.U << rowLog)
  assert(!writer.io.axi.aw.valid || begin >= settings.window.base && end <= settings.window.end, "no row outside it")
  cover(bursts === 2.U)
  cover(writer.io.isOutside)
}

/** An image of any contents, size and place: nothing outside its window is read, and loads stay in their memories. */
class ImageLoaderProof(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  private val loader = Module(new ImageLoader(config, shell))

  val start    = IO(Input(Bool()))
  val settings = IO(Input(new ImageSettings))
  val load     = IO(Input(Bool()))
  val ar       = IO(Input(Bool()))
  val answers  = IO(Input(Bool()))
  val data     = IO(Input(UInt((8 * shell.busBytes).W)))
  val response = IO(Input(UInt(2.W)))
  loader.io.start        := start && loader.io.isIdle
  loader.io.settings     := settings
  loader.io.load.ready   := load
  loader.io.axi.ar.ready := ar
  private val isFirst = RegNext(false.B, true.B)
  assume(isFirst || loader.io.isIdle || settings.asUInt === RegNext(settings.asUInt))

  private val beats = RegInit(0.U(12.W))
  private val axi   = loader.io.axi
  axi.r.valid     := answers && beats =/= 0.U
  axi.r.bits      := 0.U.asTypeOf(axi.r.bits)
  axi.r.bits.data := data
  axi.r.bits.resp := response
  beats           := beats + Mux(axi.ar.fire, axi.ar.bits.len +& 1.U, 0.U) - axi.r.fire

  AxiRules.holds(axi.ar, "ar")
  private val end      = axi.ar.bits.addr +& ImageReader.burstBytes.U
  private val isInside = axi.ar.bits.addr >= settings.window.base && end <= settings.window.end
  assert(!axi.ar.valid || isInside, "nothing is read outside the window")
  assert(!axi.ar.valid || end <= settings.base +& settings.bytes, "nothing is read beyond the image")
  assert(!axi.r.valid || axi.r.ready, "data never wait")
  assert(!loader.io.isIdle || beats === 0.U, "idle when all is answered")
  cover(axi.r.fire)
  private val wasBusy = RegNext(!loader.io.isIdle, false.B)
  cover(wasBusy && loader.io.isIdle && loader.io.errors.response)
}

/** The rules of the bus, for all inputs. */
class ShellProofsSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  private val config = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(tileSize = 4, hits = false))

  behavior of "AxiWriteGuard"

  it should "end all bursts by AXI's rules, whenever the master is reset" in
    proveUntil(cycles = 9)(new AxiWriteGuardProof(4))

  behavior of "AxiReadGuard"

  it should "take all data, whenever the master is reset" in prove(new AxiReadGuardProof(4))

  behavior of "AxiWindow"

  it should "keep bursts in the window, and answer those that leave it" in prove(new AxiWindowProof(4))

  behavior of "BurstWriter"

  it should "write nothing outside the window, rows of less, as much and more than a beat" in
    proveUntil(cycles = 6)(new BurstWriterProof(config, ShellConfig(16)))

  behavior of "ImageLoader"

  it should "read nothing outside the window, whatever the image" in
    proveUntil(cycles = 8)(new ImageLoaderProof(config, ShellConfig(128)))
}
