package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, MuxLookup, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{FrameRegisters, Rgb, Shading}
import colonnade.numbers.{Fixed, Rounding}

/** Ports of [[ColourUnit]]. */
final class ColourUnitIO(config: ColonnadeConfig) extends Bundle {
  val ambient    = Input(Rgb(FrameRegisters.intensity))
  val background = Input(Rgb(FrameRegisters.colour))
  val shading    = Input(new Shading(config))

  /** The surface at which a context's path ends; remembered. */
  val surface = Flipped(Valid(new LitSurface(config)))
  val bounce  = if (config.frame.hasBounces) Some(Flipped(Decoupled(new BounceUpdate(config)))) else None
  val end     = Flipped(Decoupled(new PathTermination(config)))
  val colour  = Valid(new PathColour(config))
}

/** Colours of paths: docs/numbers.md, 5.9 and 6. A path has a radiance so far, and a throughput that weights what it still
  * hits.
  *
  * One path at a time, two cycles per product and channel. A path's end takes 2 + 6 · (lights + 2) cycles, or 8 in the
  * background. A bounce takes 20 cycles, and 6 · (lights + 1) more if its reflection shows a surface. Bounces have
  * priority. A shadow ratio takes 12 cycles per channel that lacks some light.
  *
  * @note colour = radiance + throughput · (emission + albedo · (ambient + the direct light of all lights · transmittance))
  */
final class ColourUnit(config: ColonnadeConfig) extends Module {
  private val lights     = config.frame.lights
  private val hasBounces = config.frame.hasBounces
  private val fraction   = NumberFormats.lightFraction
  private val colourBits = NumberFormats.colourBits
  private val sumBits    = NumberFormats.lightBits + log2Ceil(lights + 1)
  private val weightBits = fraction + 1

  val io = IO(new ColourUnitIO(config))

  // Tables, by context
  private val surfaces = ContextTable(config, new TerminalSurface(config))
  private val paths    = if (hasBounces) Some(ContextTable(config, new PathState)) else None

  when(io.surface.valid) {
    val surface = Wire(new TerminalSurface(config))
    surface.albedo      := io.surface.bits.albedo
    surface.directLight := io.surface.bits.directLight
    surface.emission.zip(io.surface.bits.emission).foreach { case (to, from) => to := from }
    surfaces.write(io.surface.bits.context, surface)
  }

  // The current path
  private val isBusy  = RegInit(false.B)
  private val isEnd   = Reg(Bool())
  private val context = Reg(Context(config))

  /** The tables' entries are read. */
  private val isRead = RegInit(false.B)

  /** The product's number and channel; and whether it is ready. */
  private val step    = Reg(UInt(log2Ceil(lights + 1).max(2).W))
  private val channel = Reg(UInt(2.W))
  private val isReady = Reg(Bool())

  /** The path had hit neither mirror nor glass before: its entry in `paths` is meaningless. */
  private val isStraight = Reg(Bool())

  /** The current product is the surface's, not the path's. */
  private val ofSurface  = Reg(Bool())
  private val hasSurface = Reg(Bool())

  private val occlusions  = Reg(Vec(lights, Occlusion()))
  private val albedo      = Reg(Vec(3, UInt(colourBits.W)))
  private val directLight = Reg(Vec(lights, Vec(3, UInt(NumberFormats.lightBits.W))))
  private val fresnel     = Reg(UInt(weightBits.W))
  private val isTinted    = Reg(Bool())
  private val throughput  = Reg(Vec(3, UInt(weightBits.W)))
  private val radiance    = Reg(Vec(3, UInt(colourBits.W)))
  private val sum         = Reg(UInt(sumBits.W))
  private val surface     = Reg(UInt(colourBits.W))
  private val emission    = if (config.frame.emission) Some(Reg(Vec(3, UInt(colourBits.W)))) else None

  /** The surface's albedo, in registers of its own if a bounce may have a surface. */
  private val surfaceAlbedo = if (hasBounces && config.hasEnvironment) Reg(Vec(3, UInt(colourBits.W))) else albedo
  private val colours       = Reg(Vec(3, UInt(colourBits.W)))
  private val ratios        = if (config.hasEnvironment) Some(Module(new ShadowRatioDivider(sumBits)).io) else None

  /** The shadow ratio is needed, and the light without shadows. */
  private val isDirectView = Reg(Bool())
  private val unshadowed   = Reg(UInt(sumBits.W))

  private val reflects = step === lights.U
  private val lastStep = Mux(ofSurface, lights.U, Mux(isEnd, 0.U, 2.U))

  // Take a bounce or an end
  private val bounces = io.bounce.map(_.fire).getOrElse(false.B)
  io.bounce.foreach(_.ready := !isBusy)
  io.end.ready := !isBusy && !io.bounce.map(_.valid).getOrElse(false.B)
  private val takes = bounces || io.end.fire
  private val taken =
    io.bounce.map(bounce => Mux(bounce.valid, bounce.bits.context, io.end.bits.context)).getOrElse(io.end.bits.context)
  private val surfaceRead = surfaces.read(taken, takes)
  private val pathRead    = paths.map(_.read(taken, takes))
  isRead := takes
  when(takes) {
    isBusy     := true.B
    isEnd      := !bounces
    context    := taken
    channel    := 0.U
    isReady    := false.B
    step       := 0.U
    isStraight := ColourUnit.isStraight(io, bounces)
    val showsSurface = Mux(bounces, io.bounce.flatMap(_.bits.hasSurface).getOrElse(false.B), !io.end.bits.isBackground)
    ofSurface  := showsSurface
    hasSurface := showsSurface
    occlusions := io.end.bits.occlusions
    when(bounces) { occlusions.foreach(_ := Occlusion.none) }
    io.bounce.foreach { bounce =>
      albedo   := VecInit(bounce.bits.albedo.channels)
      fresnel  := bounce.bits.fresnel.natural
      isTinted := bounce.bits.isTinted
    }
    isDirectView := !bounces && io.end.bits.isDirectView.getOrElse(false.B)
  }
  when(isRead) {
    throughput := VecInit.fill(3)((1 << fraction).U)
    radiance   := VecInit.fill(3)(0.U)
    pathRead.foreach { path =>
      when(!isStraight) {
        throughput := VecInit(path.throughput.map(_.natural))
        radiance   := VecInit(path.radiance.channels)
      }
    }
    when(hasSurface) {
      surfaceAlbedo := VecInit(surfaceRead.albedo.channels)
      directLight   := VecInit(surfaceRead.directLight.map(light => VecInit(light.channels.map(_.natural))))
      emission.zip(surfaceRead.emission).foreach { case (to, from) => to := VecInit(from.channels) }
    }
  }

  private def of[T <: Data](channels: Seq[T]): T =
    MuxLookup(channel, channels(2))(Seq(0.U -> channels(0), 1.U -> channels(1)))

  // One product
  private val one                               = (1 << fraction).U(weightBits.W)
  private val shadowTransmittance               = io.shading.shadowTransmittance.map(_.natural).getOrElse(one)
  private val light                             = step(log2Ceil(lights.max(2)) - 1, 0)
  private val reflectance                       = of(surfaceAlbedo)
  private def at[T <: Data](entries: Vec[T]): T = if (lights == 1) entries.head else entries(light)
  private val transmittance                     =
    MuxLookup(at(occlusions), 0.U)(Seq(Occlusion.none -> one, Occlusion.transmissive -> shadowTransmittance))
  private val hitColour = Mux(hasSurface, surface, of(io.background.channels))
  private val albedoNow = of(albedo)

  /** All ones is 1.0. */
  private val tint = Mux(isTinted, albedoNow +& albedoNow(colourBits - 1), one)
  private val left = Mux(
    ofSurface,
    Mux(reflects, sum, of(at(directLight))),
    Mux(isEnd, hitColour, Mux(step === 2.U, sum, of(throughput)))
  )
  private val right = Mux(
    ofSurface,
    Mux(reflects, reflectance, transmittance),
    Mux(isEnd, of(throughput), Mux(step === 0.U, tint, Mux(step === 1.U, fresnel, hitColour)))
  )
  private val product = Reg(UInt((sumBits + weightBits).W))
  product := left * right
  private val part   = Rounding.floor(product, fraction)
  private val colour = Rounding.saturate(part, colourBits)
  private val shown  = emission.map(value => Rounding.saturate(colour +& of(value), colourBits)).getOrElse(colour)
  private val total  = Rounding.saturate(of(radiance) +& part, colourBits)

  // Use the product
  private val retires   = RegInit(false.B)
  private val divides   = ratios.map(_.busy).getOrElse(false.B)
  private val isWorking = isBusy && !isRead && !retires && !divides
  private val isDone    = isWorking && isReady && !ofSurface && step === lastStep && channel === 2.U
  private val first     = of(io.ambient.channels).natural
  when(isWorking) {
    isReady := !isReady
    when(isReady) {
      step := step + 1.U
      when(step === lastStep) {
        step      := 0.U
        ofSurface := !ofSurface && hasSurface
        when(!ofSurface) { channel := channel + 1.U }
      }
      when(ofSurface) {
        when(reflects) { surface := shown }.otherwise { sum := Mux(step === 0.U, first, sum) + part }
        when(!reflects) { unshadowed := Mux(step === 0.U, first, unshadowed) + of(at(directLight)) }
      }.elsewhen(isEnd) {
        set(colours, total)
      }.otherwise {
        when(step === 0.U) { set(throughput, Rounding.narrow(part, weightBits)) }
        when(step === 1.U) {
          sum := part
          set(throughput, of(throughput) - Rounding.narrow(part, weightBits))
        }
        when(step === 2.U) { set(radiance, total) }
      }
    }
  }

  // In the cycle after the last product, a bounce's path is remembered, and an end's colour retires
  retires := isDone
  when(retires) { isBusy := false.B }
  io.colour.valid        := retires && isEnd
  io.colour.bits.context := context
  io.colour.bits.colour.channels.zip(colours).foreach { case (to, from) => to := from }
  for (divider <- ratios; to <- io.colour.bits.ratio) {
    divider.start.valid        := isWorking && isReady && ofSurface && reflects && isDirectView
    divider.start.bits.part    := sum
    divider.start.bits.channel := channel
    divider.whole              := unshadowed
    to.channels.zip(divider.ratios).foreach { case (channel, part) => channel := Fixed(channel.format, part) }
  }
  paths.foreach { table =>
    when(retires && !isEnd) {
      val path = Wire(new PathState)
      path.throughput.zip(throughput).foreach { case (to, from) => to := Fixed(to.format, from) }
      path.radiance.channels.zip(radiance).foreach { case (to, from) => to := from }
      table.write(context, path)
    }
  }
  private def set(channels: Vec[UInt], value: UInt): Unit =
    for (index <- 0 until 3) when(channel === index.U) { channels(index) := value }
}

object ColourUnit {

  /** Whether the path of a bounce that is taken, or else of an end, is new. */
  private[shading] def isStraight(io: ColourUnitIO, isBounce: Bool): Bool =
    io.bounce.map(bounce => Mux(isBounce, bounce.bits.isFirst, io.end.bits.isStraight.get)).getOrElse(true.B)

  /** The ports of a new unit: with `units.pipelined` a [[ColourPipeline]]. */
  def apply(config: ColonnadeConfig): ColourUnitIO =
    if (config.units.pipelined) Module(new ColourPipeline(config)).io else Module(new ColourUnit(config)).io
}

/** The surface at which a path ends. */
final private class TerminalSurface(config: ColonnadeConfig) extends Bundle {
  val albedo      = Rgb(FrameRegisters.colour)
  val directLight = Vec(config.frame.lights, Rgb(FrameRegisters.intensity))
  val emission    = if (config.frame.emission) Some(Rgb(FrameRegisters.colour)) else None
}

/** A path after its bounces so far. */
final private class PathState extends Bundle {

  /** The weight of what the path still hits, by channel. */
  val throughput = Vec(3, FrameRegisters.weight)

  /** The colour so far. */
  val radiance = Rgb(FrameRegisters.colour)
}
