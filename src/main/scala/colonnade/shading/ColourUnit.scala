package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, MuxLookup, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{FrameRegisters, Rgb, Shading}
import colonnade.numbers.{Fixed, Rounding}

final class ColourUnitIO(config: ColonnadeConfig) extends Bundle {
  val ambient    = Input(Rgb(FrameRegisters.intensity))
  val background = Input(Rgb(FrameRegisters.colour))
  val shading    = Input(new Shading(config))

  /** A context takes a new pixel: its path begins. */
  val begins = Flipped(Valid(Context(config)))

  /** The surface that a context's path will end at; remembered. */
  val surface = Flipped(Valid(new LitSurface(config)))
  val turn    = if (config.frame.hasBounces) Some(Flipped(Decoupled(new PathTurn(config)))) else None
  val end     = Flipped(Decoupled(new PathEnd(config)))
  val colour  = Valid(new PathColour(config))
}

/** Colours of paths: docs/numbers.md, 5.9 and 6. What a path has passed weighs what it still meets (its throughput), and
  * what is certain is gathered.
  *
  * One path at a time, two cycles a product and channel: an end takes 2 + 6 · (lights + 2) cycles, one in the background
  * 8, a turn 20, and 6 · (lights + 1) more before a surface. Turns go first. A ratio takes 12 cycles a channel, if some
  * light is missing.
  *
  * @note colour = gathered + throughput · albedo · (ambient + the sum of all lights, less what is in their way)
  */
final class ColourUnit(config: ColonnadeConfig) extends Module {
  private val lights     = config.frame.lights
  private val hasBounces = config.frame.hasBounces
  private val fraction   = NumberFormats.lightFraction
  private val colourBits = NumberFormats.colourBits
  private val sumBits    = NumberFormats.lightBits + log2Ceil(lights + 1)
  private val shareBits  = fraction + 1

  val io = IO(new ColourUnitIO(config))

  // What each context remembers
  private val surfaces = ContextTable(config, new EndSurface(config))
  private val paths    = if (hasBounces) Some(ContextTable(config, new PathSoFar)) else None

  /** The path has met neither mirror nor glass yet: its entry means nothing. */
  private val isStraight = Reg(Vec(config.array.contexts, Bool()))
  when(io.surface.valid) {
    val surface = Wire(new EndSurface(config))
    surface.albedo  := io.surface.bits.albedo
    surface.directs := io.surface.bits.directs
    surfaces.write(io.surface.bits.context, surface)
  }

  // The path in work
  private val isBusy  = RegInit(false.B)
  private val isEnd   = Reg(Bool())
  private val context = Reg(Context(config))

  /** The tables' entries come. */
  private val arrives = RegInit(false.B)

  /** Which product, of which channel; and whether it is there. */
  private val step    = Reg(UInt(log2Ceil(lights + 1).max(2).W))
  private val channel = Reg(UInt(2.W))
  private val isThere = Reg(Bool())

  /** Products of the surface, before those of the path. */
  private val ofSurface  = Reg(Bool())
  private val hasSurface = Reg(Bool())

  private val occlusions = Reg(Vec(lights, Occlusion()))
  private val albedo     = Reg(Vec(3, UInt(colourBits.W)))
  private val directs    = Reg(Vec(lights, Vec(3, UInt(NumberFormats.lightBits.W))))
  private val share      = Reg(UInt(shareBits.W))
  private val isTinted   = Reg(Bool())
  private val throughput = Reg(Vec(3, UInt(shareBits.W)))
  private val gathered   = Reg(Vec(3, UInt(colourBits.W)))
  private val sum        = Reg(UInt(sumBits.W))
  private val surface    = Reg(UInt(colourBits.W))

  /** Beside that of the turn where a turn may have a surface. */
  private val surfaceAlbedo = if (hasBounces && config.hasRoom) Reg(Vec(3, UInt(colourBits.W))) else albedo
  private val colours       = Reg(Vec(3, UInt(colourBits.W)))
  private val ratios        = if (config.hasRoom) Some(new Ratios(sumBits)) else None

  private val reflects = step === lights.U
  private val lastStep = Mux(ofSurface, lights.U, Mux(isEnd, 0.U, 2.U))

  // Take one
  private val turns = io.turn.map(_.fire).getOrElse(false.B)
  io.turn.foreach(_.ready := !isBusy)
  io.end.ready := !isBusy && !io.turn.map(_.valid).getOrElse(false.B)
  private val takes = turns || io.end.fire
  private val taken =
    io.turn.map(turn => Mux(turn.valid, turn.bits.context, io.end.bits.context)).getOrElse(io.end.bits.context)
  private val surfaceRead = surfaces.read(taken, takes)
  private val pathRead    = paths.map(_.read(taken, takes))
  arrives := takes
  when(takes) {
    isBusy  := true.B
    isEnd   := !turns
    context := taken
    channel := 0.U
    isThere := false.B
    step    := 0.U
    val before = Mux(turns, io.turn.flatMap(_.bits.hasSurface).getOrElse(false.B), !io.end.bits.isBackground)
    ofSurface  := before
    hasSurface := before
    occlusions := io.end.bits.occlusions
    when(turns) { occlusions.foreach(_ := Occlusion.none) }
    io.turn.foreach { turn =>
      albedo   := VecInit(turn.bits.albedo.channels)
      share    := turn.bits.share.natural
      isTinted := turn.bits.isTinted
    }
  }
  when(arrives) {
    val begun = isStraight(context)
    throughput := VecInit.fill(3)((1 << fraction).U)
    gathered   := VecInit.fill(3)(0.U)
    pathRead.foreach { path =>
      when(!begun) {
        throughput := VecInit(path.throughput.map(_.natural))
        gathered   := VecInit(path.gathered.channels)
      }
    }
    when(hasSurface) {
      surfaceAlbedo := VecInit(surfaceRead.albedo.channels)
      directs       := VecInit(surfaceRead.directs.map(direct => VecInit(direct.channels.map(_.natural))))
    }
  }

  private def of[T <: Data](channels: Seq[T]): T =
    MuxLookup(channel, channels(2))(Seq(0.U -> channels(0), 1.U -> channels(1)))

  // One product
  private val whole                             = (1 << fraction).U(shareBits.W)
  private val clearness                         = io.shading.clearness.map(_.natural).getOrElse(whole)
  private val light                             = step(log2Ceil(lights.max(2)) - 1, 0)
  private val reflectance                       = of(surfaceAlbedo)
  private def at[T <: Data](entries: Vec[T]): T = if (lights == 1) entries.head else entries(light)
  private val passing   = MuxLookup(at(occlusions), 0.U)(Seq(Occlusion.none -> whole, Occlusion.clear -> clearness))
  private val behind    = Mux(hasSurface, surface, of(io.background.channels))
  private val albedoNow = of(albedo)

  /** All ones is 1.0. */
  private val tint = Mux(isTinted, albedoNow +& albedoNow(colourBits - 1), whole)
  private val left = Mux(
    ofSurface,
    Mux(reflects, sum, of(at(directs))),
    Mux(isEnd, behind, Mux(step === 2.U, sum, of(throughput)))
  )
  private val right = Mux(
    ofSurface,
    Mux(reflects, reflectance, passing),
    Mux(isEnd, of(throughput), Mux(step === 0.U, tint, Mux(step === 1.U, share, behind)))
  )
  private val product = Reg(UInt((sumBits + shareBits).W))
  product := left * right
  private val part   = Rounding.floor(product, fraction)
  private val colour = Rounding.saturate(part, colourBits)
  private val total  = Rounding.saturate(of(gathered) +& part, colourBits)

  // What it means
  private val leaves    = RegInit(false.B)
  private val divides   = ratios.map(_.isBusy).getOrElse(false.B)
  private val isWorking = isBusy && !arrives && !leaves && !divides
  private val isDone    = isWorking && isThere && !ofSurface && step === lastStep && channel === 2.U
  private val first     = of(io.ambient.channels).natural
  when(isWorking) {
    isThere := !isThere
    when(isThere) {
      step := step + 1.U
      when(step === lastStep) {
        step      := 0.U
        ofSurface := !ofSurface && hasSurface
        when(!ofSurface) { channel := channel + 1.U }
      }
      when(ofSurface) {
        when(reflects) { surface := colour }.otherwise { sum := Mux(step === 0.U, first, sum) + part }
        ratios.foreach { ratio =>
          when(reflects) { ratio.begin(sum, channel) }.otherwise {
            ratio.whole := Mux(step === 0.U, first, ratio.whole) + of(at(directs))
          }
        }
      }.elsewhen(isEnd) {
        set(colours, total)
      }.otherwise {
        when(step === 0.U) { set(throughput, Rounding.narrow(part, shareBits)) }
        when(step === 1.U) {
          sum := part
          set(throughput, of(throughput) - Rounding.narrow(part, shareBits))
        }
        when(step === 2.U) { set(gathered, total) }
      }
    }
  }

  // A turned path is remembered, an end's colour leaves, in the cycle after the last product
  leaves := isDone
  when(leaves) { isBusy := false.B }
  io.colour.valid        := leaves && isEnd
  io.colour.bits.context := context
  io.colour.bits.colour.channels.zip(colours).foreach { case (to, from) => to := from }
  for (ratio <- ratios; to <- io.colour.bits.ratio) {
    ratio.work()
    when(takes) { ratio.isWanted := !turns && io.end.bits.isSeen.get }
    to.channels.zip(ratio.found).foreach { case (channel, part) => channel := Fixed(channel.format, part) }
  }
  paths.foreach { table =>
    when(leaves && !isEnd) {
      val path = Wire(new PathSoFar)
      path.throughput.zip(throughput).foreach { case (to, from) => to := Fixed(to.format, from) }
      path.gathered.channels.zip(gathered).foreach { case (to, from) => to := from }
      table.write(context, path)
      isStraight(context) := false.B
    }
  }
  when(io.begins.valid) { isStraight(io.begins.bits) := true.B }

  private def set(channels: Vec[UInt], value: UInt): Unit =
    for (index <- 0 until 3) when(channel === index.U) { channels(index) := value }
}

/** What an end needs of its surface. */
final private class EndSurface(config: ColonnadeConfig) extends Bundle {
  val albedo  = Rgb(FrameRegisters.colour)
  val directs = Vec(config.frame.lights, Rgb(FrameRegisters.intensity))
}

/** What a path has passed. */
final private class PathSoFar extends Bundle {

  /** What part of what comes now counts, by channel. */
  val throughput = Vec(3, FrameRegisters.share)

  /** What is certain already. */
  val gathered = Rgb(FrameRegisters.colour)
}
