package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, MuxLookup}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, Rounding}

/** [[ColourUnit]] as a pipeline, a channel a cycle: docs/shading.md. {{{
  *
  * end ────┬▶ read ─▶ light · transmittance ─▶ light · albedo  ─▶ throughput · colour ─▶ colour, path
  * bounce ─┘          throughput · tint        tinted · Fresnel   part · behind
  * }}}
  * An end takes 3 · lights cycles, with the lights that are on, at least one; in the background 3. A bounce takes 6, and
  * 3 · lights more if its reflection shows a surface. Colours come in any order; the throughput and radiance of every path
  * are in a table.
  */
final class ColourPipeline(config: ColonnadeConfig) extends Module {
  private val lights         = config.frame.lights
  private val hasBounces     = config.frame.hasBounces
  private val hasReflections = hasBounces && config.hasEnvironment
  private val fraction       = NumberFormats.lightFraction
  private val colourBits     = NumberFormats.colourBits
  private val sumBits        = NumberFormats.lightBits + log2Ceil(lights + 1)
  private val weightBits     = fraction + 1
  private val one            = (1 << fraction).U(weightBits.W)

  val io = IO(new ColourUnitIO(config))

  // The operation: a bounce or an end; and the next one, while it is read
  private val isReading = RegInit(false.B)
  private val isIssuing = RegInit(false.B)
  private val next      = Reg(new ColourOperation(config))
  private val operation = Reg(new ColourOperation(config))
  import operation.{context, hasSurface, isBounce, needsRatio, occlusions}
  private val albedo   = Reg(Vec(3, UInt(colourBits.W)))
  private val isTinted = Reg(Bool())
  private val fresnel  = Reg(UInt(weightBits.W))

  /** A slot of the operation is a channel and a light of its surface, or a channel of its path. */
  private val ofSurface = Reg(Bool())
  private val channel   = Reg(UInt(2.W))
  private val light     = Reg(UInt(log2Ceil(lights.max(2)).W))

  /** A path that a bounce is about to change; `isSettled` is false for one cycle more, for the table. */
  private val isUpdating    = RegInit(false.B)
  private val isSettled     = RegNext(!isUpdating, true.B)
  private val resultContext = Reg(Context(config))
  private val ratios        = Option.when(config.hasEnvironment)(Module(new ShadowRatios(config, sumBits)).io)

  private val isFirst     = channel === 0.U && light === 0.U
  private val waits       = isUpdating || (isFirst && needsRatio && ratios.map(_.busy).getOrElse(false.B))
  private val issues      = isIssuing && !waits
  private val lastLight   = !ofSurface || light +& 1.U >= io.shading.lights // a light that is off adds nothing
  private val lastPass    = !(isBounce && ofSurface)
  private val isLast      = issues && lastLight && lastPass && channel === 2.U
  private val lightThen   = Mux(lastLight, 0.U, light + 1.U)
  private val channelThen = Mux(!lastLight, channel, Mux(channel === 2.U, 0.U, channel + 1.U))
  when(issues) {
    light   := lightThen
    channel := channelThen
    when(lastLight && channel === 2.U && isBounce) { ofSurface := false.B }
  }
  ratios.foreach(_.claim := issues && isFirst && needsRatio)

  // Take one while the last slot is issued; an end after an end one cycle before
  private val isFree   = !isReading && (!isIssuing || isLast)
  private val endsNext =
    issues && !isBounce && channelThen === 2.U && (!ofSurface || lightThen +& 1.U >= io.shading.lights)
  private val bounces = io.bounce.map(_.fire).getOrElse(false.B)
  private val takes   = bounces || io.end.fire
  private val taken   =
    io.bounce.map(bounce => Mux(bounce.valid, bounce.bits.context, io.end.bits.context)).getOrElse(io.end.bits.context)
  io.bounce.foreach(_.ready := isFree)
  io.end.ready := (isFree || (endsNext && !isReading)) && !io.bounce.map(_.valid).getOrElse(false.B)
  when(takes) {
    next.context    := taken
    next.isBounce   := bounces
    next.occlusions := io.end.bits.occlusions
    when(bounces) { next.occlusions.foreach(_ := Occlusion.none) }
    val showsSurface = Mux(bounces, io.bounce.flatMap(_.bits.hasSurface).getOrElse(false.B), !io.end.bits.isBackground)
    next.hasSurface := showsSurface
    next.needsRatio := !bounces && showsSurface && io.end.bits.isDirectView.getOrElse(false.B) &&
      io.end.bits.occlusions.map(_ =/= Occlusion.none).reduce(_ || _)
    for (bounce <- io.bounce) when(bounces) {
      albedo   := VecInit(bounce.bits.albedo.channels)
      isTinted := bounce.bits.isTinted
      fresnel  := bounce.bits.fresnel.natural
    }
  }

  // Read its surface once; and its path again and again while a bounce of the same path is under way
  private val repeats = isReading && !(isSettled && !isUpdating) && resultContext === next.context
  private val reads   = takes || repeats
  private val starts  = isReading && !repeats
  assert(!starts || !isIssuing || isLast, "an operation before the end of another one")
  isReading := reads
  when(starts) {
    isIssuing := true.B
    operation := next
    ofSurface := next.hasSurface
    channel   := 0.U
    light     := 0.U
  }.elsewhen(isLast) { isIssuing := false.B }

  private val surfaces      = ContextTable(config, new TerminalSurface(config))
  private val surface       = surfaces.read(taken, takes)
  private val surfaceAlbedo = if (hasReflections) Reg(Vec(3, UInt(colourBits.W))) else albedo
  private val directLight   = Reg(Vec(lights, Vec(3, UInt(NumberFormats.lightBits.W))))
  private val emission      = Option.when(config.frame.emission)(Reg(Vec(3, UInt(colourBits.W))))
  when(io.surface.valid) {
    val surface = Wire(new TerminalSurface(config))
    surface.albedo      := io.surface.bits.albedo
    surface.directLight := io.surface.bits.directLight
    surface.emission.zip(io.surface.bits.emission).foreach { case (to, from) => to := from }
    surfaces.write(io.surface.bits.context, surface)
  }
  when(RegNext(takes, false.B)) {
    when(hasReflections.B || !next.isBounce) { surfaceAlbedo := VecInit(surface.albedo.channels) }
    directLight := VecInit(surface.directLight.map(light => VecInit(light.channels.map(_.natural))))
    emission.zip(surface.emission).foreach { case (to, from) => to := VecInit(from.channels) }
  }

  private val paths      = Option.when(hasBounces)(ContextTable(config, new PathState))
  private val throughput = if (hasBounces) Reg(Vec(3, UInt(weightBits.W))) else VecInit.fill(3)(one)
  private val radiance   = if (hasBounces) Reg(Vec(3, UInt(colourBits.W))) else VecInit.fill(3)(0.U(colourBits.W))
  for (path <- paths.map(_.read(Mux(repeats, next.context, taken), reads)))
    when(isReading) {
      throughput := VecInit(path.throughput.map(_.natural))
      radiance   := VecInit(path.radiance.channels)
    }

  private def of[T <: Data](channels: Seq[T], channel: UInt = channel): T =
    MuxLookup(channel, channels(2))(Seq(0.U -> channels(0), 1.U -> channels(1)))

  private def background(slot: ColourSlot): UInt = of(io.background.channels, slot.channel)

  private def at[T <: Data](entries: Vec[T]): T = if (lights == 1) entries.head else entries(light)

  private def drop(product: UInt, width: Int): UInt = Rounding.narrow(Rounding.floor(product, fraction), width)

  // Light that arrives at the surface, or the tinted throughput
  private val shadowTransmittance = io.shading.shadowTransmittance.map(_.natural).getOrElse(one)
  private val transmittance       =
    MuxLookup(at(occlusions), 0.U)(Seq(Occlusion.none -> one, Occlusion.transmissive -> shadowTransmittance))
  private val tint    = Mux(isTinted, of(albedo) +& of(albedo)(colourBits - 1), one)
  private val direct  = of(at(directLight))
  private val left    = Mux(ofSurface, direct, of(throughput))
  private val right   = Mux(ofSurface, transmittance, tint)
  private val lit     = Reg(UInt(sumBits.W))
  private val all     = Reg(UInt(sumBits.W))
  private val ambient = of(io.ambient.channels).natural
  lit := Mux(ofSurface, Mux(light === 0.U, ambient, lit), 0.U) + drop(left * right, NumberFormats.lightBits)
  all := Mux(light === 0.U, ambient, all) + direct

  private val atAlbedo = Wire(new ColourSlot(config))
  atAlbedo.isLast     := isLast
  atAlbedo.isPath     := lastPass
  atAlbedo.isBounce   := isBounce
  atAlbedo.hasSurface := hasSurface
  atAlbedo.needsRatio := needsRatio
  atAlbedo.channel    := channel
  atAlbedo.radiance   := of(radiance)
  atAlbedo.weight     := of(throughput)
  atAlbedo.emission.zip(emission).foreach { case (to, from) => to := of(from) }
  private val hasLit = RegNext(issues && lastLight, false.B)
  private val slot   = RegNext(atAlbedo)
  private val factor = Reg(UInt(weightBits.W))
  factor := Mux(ofSurface, of(surfaceAlbedo), fresnel)
  for (ratios <- ratios) {
    ratios.load.valid        := hasLit && slot.needsRatio
    ratios.load.bits.part    := lit
    ratios.load.bits.channel := slot.channel
    ratios.whole             := all
  }

  // The light that leaves the surface, or the weight of the Fresnel reflection
  private val reflected = Rounding.floor(lit * factor, fraction)
  private val colour    = Rounding.saturate(reflected, colourBits)
  private val shown = slot.emission.map(emission => Rounding.saturate(colour +& emission, colourBits)).getOrElse(colour)
  private val seen  = Reg(UInt(weightBits.W))
  seen := Mux(
    slot.isBounce && slot.isPath,
    Rounding.narrow(reflected, weightBits),
    Mux(slot.hasSurface, shown, background(slot))
  )
  private val reflection = Reg(Vec(3, UInt(colourBits.W)))
  when(hasLit && !slot.isPath) { shiftIn(reflection, shown) }

  private val atPath = WireInit(slot)
  when(slot.isBounce) { atPath.weight := Rounding.narrow(lit, weightBits) }
  private val hasSeen = RegNext(hasLit && slot.isPath, false.B)
  private val last    = RegNext(atPath)
  private val weighed =
    if (hasBounces)
      Mux(last.isBounce, Mux(last.hasSurface, of(reflection, last.channel), background(last)), last.weight)
    else last.weight
  private val total = Rounding.saturate(last.radiance +& drop(seen * weighed, weightBits), colourBits)

  // The path's colour so far, and what it still lets through
  private val colours = Reg(Vec(3, UInt(colourBits.W)))
  private val weights = Reg(Vec(3, UInt(weightBits.W)))
  when(hasSeen) {
    shiftIn(colours, total)
    shiftIn(weights, last.weight - seen)
  }
  private val isDone   = RegNext(hasSeen && last.isLast, false.B)
  private val isStream = RegNext(!last.isBounce && !last.needsRatio)
  when(isLast) { resultContext := context }

  // An end's colour leaves, or waits for its ratio
  private val isShown = isDone && isStream
  private val result  = Wire(new PathColour(config))
  result.context := resultContext
  result.colour.channels.zip(colours).foreach { case (to, from) => to := from }
  result.ratio.foreach(_.channels.foreach(to => to := Fixed(to.format, one)))
  io.colour.valid := isShown
  io.colour.bits  := result
  for (ratios <- ratios) {
    ratios.colour.valid := isDone && RegNext(last.needsRatio)
    ratios.colour.bits  := result
    ratios.result.ready := !isShown
    when(!isShown) {
      io.colour.valid := ratios.result.valid
      io.colour.bits  := ratios.result.bits
    }
  }

  // A bounce's path enters the table, which has one write port: new paths have priority
  for (table <- paths) {
    val isBounced = RegInit(false.B)
    val path      = Wire(new PathState)
    path.throughput.zip(weights).foreach { case (to, from) =>
      to := Fixed(to.format, Mux(io.start.valid, one, from))
    }
    path.radiance.channels.zip(colours).foreach { case (to, from) => to := Mux(io.start.valid, 0.U, from) }
    when(io.start.valid || isBounced) { table.write(Mux(io.start.valid, io.start.bits, resultContext), path) }
    when(hasSeen && last.isLast && last.isBounce) { isBounced := true.B }.elsewhen(!io.start.valid) {
      isBounced := false.B
    }
    when(isLast && isBounce) { isUpdating := true.B }.elsewhen(isBounced && !io.start.valid) { isUpdating := false.B }
  }

  private def shiftIn(channels: Vec[UInt], value: UInt): Unit = {
    channels(0) := channels(1)
    channels(1) := channels(2)
    channels(2) := value
  }
}
