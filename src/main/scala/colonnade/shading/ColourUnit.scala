package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, DecoupledIO, Fill, MuxLookup, RegEnable, Valid}
import colonnade.common.ContextTable
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Rgb, Shading}
import colonnade.numbers.{Fixed, Rounding}

final class ColourUnitIO(config: PathConfig) extends Bundle {
  val ambient    = Input(Rgb(FrameRegisters.intensity))
  val background = Input(Rgb(FrameRegisters.colour))
  val shading    = Input(new Shading(config.device))
  val surface    = Flipped(Valid(new LitSurface(config))) // the surface at which a context's path ends; remembered
  val bounce     = if (config.device.frame.hasBounces) Some(Flipped(Decoupled(new BounceUpdate(config)))) else None
  val end        = Flipped(Decoupled(new PathTermination(config)))
  val colour     = Valid(new PathColour(config))

  val continued = Valid(new ContinuedPath(config)) // a path whose surface's light is added, and which goes on
  val cube      = new LightPort(config)            // the light cube
}

/** Colours of paths: docs/numbers.md, 5.9 and 6. A path has a radiance so far, and a throughput that weights what it
  * still hits. They are in a table. A pipeline, a slot of a `ColourSchedule` a cycle: docs/shading.md. {{{
  *
  * bounce, end ─▶ read ─▶ product ─▶ sum ─▶ reflected ─▶ seen ─▶ part ─▶ colour or radiance, throughput
  *
  * slots of    product                what the sum begins with  reflected  seen                part
  * end         light · transmittance  ambient, radiance or 0    · albedo   outgoing or beyond  · throughput
  * reflection  light · transmittance  ambient                   · albedo   outgoing: kept
  * throughput  throughput · tint      0                         · fresnel  what is reflected   · kept or beyond
  * }}}
  * Outgoing is what a surface reflects and emits, and beyond is the background or light of the cube. An end has 3 ·
  * lights slots, with the lights that are on, at least one; without a surface 3. A bounce has 3, and 3 · lights more if
  * its reflection shows a surface; none if it is the path's first and has no Fresnel reflection. A surface that gathers
  * has 3 more than an end. Colours come in any order.
  *
  * @note colour = radiance + throughput · (emission + albedo · (ambient + the direct light of all lights ·
  * transmittance))
  */
final class ColourUnit(config: PathConfig) extends Module {
  private val lights     = config.device.frame.lights
  private val hasBounces = config.device.frame.hasBounces
  private val fraction   = NumberFormats.lightFraction
  private val colourBits = NumberFormats.colourBits
  private val sumBits    = NumberFormats.lightBits + log2Ceil(lights + 1)
  private val weightBits = fraction + 1
  private val hasCube    = PathEnd.has(config, PathEnd.cube)
  private val seenBits   = if (hasCube) NumberFormats.lightBits else weightBits
  private val one        = (1 << fraction).U(weightBits.W)

  val io = IO(new ColourUnitIO(config))

  // Operations: the next one, while its path and surface are read, and the one whose slots are issued
  private val isReading = RegInit(false.B)
  private val next      = Reg(new ColourOperation(config))
  private val operation = Reg(new ColourOperation(config))
  private val schedule  = new ColourSchedule(config, operation, io.shading.lights)
  private val ratios    = Option.when(config.device.hasEnvironment)(Module(new ShadowRatios(config, sumBits)).io)

  /** A path of the slots enters the table; one of a context will. */
  private val isWriting  = Wire(Bool())
  private val isUpdating = Wire(Bool())

  // Take one while the last slot is issued, or in the cycle before
  private val isFree    = !isReading && schedule.endsSoon
  private val isDirect  = io.bounce.map(isTintOnly).getOrElse(false.B)
  private val mayBounce = io.bounce.map(_.valid && !isDirect).getOrElse(false.B)
  private val bounces   = mayBounce && isFree
  private val enters    = bounces || io.end.fire
  private val taken     = Wire(new ColourOperation(config))
  io.bounce.foreach(_.ready := Mux(isDirect, !isWriting, isFree))
  io.end.ready := isFree && !mayBounce
  takeEnd(io.end.bits)
  for (bounce <- io.bounce) when(mayBounce) { takeBounce(bounce.bits) }
  when(enters) { next := taken }
  io.cube.read.valid             := enters && taken.end.isInCube
  io.cube.read.bits.context      := taken.context
  io.cube.read.bits.seesLights   := bounces || !io.end.bits.isScattered
  io.cube.read.bits.isReflection := bounces

  // Its slots follow the operation before. Its path is read again and again while a bounce of the same path is
  // under way, or while the ratio unit is busy
  private val starts  = isReading && !isUpdating && !(next.needsRatio && ratios.map(_.busy).getOrElse(false.B))
  private val repeats = isReading && !starts
  isReading := enters || repeats
  schedule.start(starts, next.end.hasSurface)
  when(starts) { operation := next }
  ratios.foreach(_.claim := starts && next.needsRatio)

  // Its surface
  private val surfaces = ContextTable(config, new TerminalSurface(config))
  private val surface  = RegEnable(surfaces.read(taken.context, enters), RegNext(enters, false.B))
  private val albedo   = surface.albedo.channels
  when(io.surface.valid) {
    val entry = Wire(new TerminalSurface(config))
    entry.albedo      := io.surface.bits.albedo
    entry.directLight := io.surface.bits.directLight
    entry.emission.zip(io.surface.bits.emission).foreach { case (to, from) => to := from }
    surfaces.write(io.surface.bits.context, entry)
  }

  // Its path
  private val paths      = Option.when(hasBounces)(ContextTable(config, new PathState))
  private val throughput = if (hasBounces) Reg(Vec(3, UInt(weightBits.W))) else VecInit.fill(3)(one)
  private val radiance   = if (hasBounces) Reg(Vec(3, UInt(colourBits.W))) else VecInit.fill(3)(0.U(colourBits.W))
  for (path <- paths.map(_.read(Mux(repeats, next.context, taken.context), enters || repeats))) when(starts) {
    val isNew = next.isStraight || next.end.hasGathered
    throughput := VecInit(path.throughput.map(weight => Mux(isNew, one, weight.natural)))
    radiance   := VecInit(path.radiance.channels.map(Mux(next.isStraight, 0.U, _)))
  }

  // The product: light that arrives at the surface, or the tinted throughput
  private val slot = Wire(new ColourSlot(config))
  slot.isValid      := schedule.isIssuing
  slot.context      := operation.context
  slot.pass         := schedule.pass
  slot.end          := operation.end
  slot.goesBack     := operation.goesBack
  slot.needsRatio   := operation.needsRatio
  slot.isLast       := schedule.isLastSlot
  slot.channel      := schedule.channel
  slot.isFirstLight := schedule.light === 0.U
  slot.isLastLight  := schedule.isLastLight
  slot.radiance     := ofChannel(radiance)
  slot.weight       := ofChannel(throughput)
  slot.emission.zip(surface.emission).foreach { case (to, from) => to := ofChannel(from.channels) }
  private val transmissive  = io.shading.shadowTransmittance.map(_.natural).getOrElse(one)
  private val transmittance = MuxLookup(schedule.ofLight(operation.occlusions), 0.U)(
    Seq(Occlusion.none -> one, Occlusion.transmissive -> transmissive)
  )
  private val tint = operation.tint.fold(one) { tint =>
    Mux(operation.end.gathers, tintOf(ofChannel(albedo)), ofChannel(tint.map(_.natural)))
  }
  private val direct  = ofChannel(schedule.ofLight(surface.directLight).channels).natural
  private val product = Reg(UInt(NumberFormats.lightBits.W))
  product := drop(
    Mux(schedule.ofSurface, direct, slot.weight) * Mux(schedule.ofSurface, transmittance, tint),
    NumberFormats.lightBits
  )

  // The sum of the lights, with and without shadows
  private val summed   = after(slot)()
  private val lit      = Reg(UInt(sumBits.W))
  private val unshaded = Reg(UInt(sumBits.W))
  private val ambient  = ofChannel(io.ambient.channels, summed.channel).natural
  private val indirect =
    Mux(summed.end.gathers, 0.U, Mux(summed.end.hasGathered, summed.radiance, ambient))
  lit      := Mux(summed.isIn(ColourPass.throughput), 0.U, Mux(summed.isFirstLight, indirect, lit)) + product
  unshaded := Mux(summed.isFirstLight, ambient, unshaded) + RegNext(direct)

  // The light that leaves the surface, or the weight of the Fresnel reflection
  private val sum = after(summed) { slot =>
    slot.isValid := summed.isValid && summed.isLastLight
    when(summed.end.hasGathered) { slot.radiance := 0.U }
  }
  private val fresnel   = operation.fresnel.map(_.natural).getOrElse(0.U(weightBits.W))
  private val factors   = Reg(Vec(2, UInt(weightBits.W)))
  private val reflected = Reg(UInt((sumBits + weightBits - fraction).W))
  factors   := VecInit(Mux(schedule.ofSurface, ofChannel(albedo), fresnel), factors(0))
  reflected := Rounding.floor(lit * factors(1), fraction)
  for (ratios <- ratios) {
    ratios.load.valid        := sum.isValid && sum.needsRatio
    ratios.load.bits.part    := lit
    ratios.load.bits.channel := sum.channel
    ratios.whole             := unshaded
  }

  // What the ray sees
  private val leaving = after(sum)(slot =>
    when(sum.isIn(ColourPass.throughput)) { slot.weight := Rounding.narrow(lit, weightBits) }
  )
  private val texel     = io.cube.texel
  private val inCube    = texel.radiance(ofChannel(texel.mantissas.channels, leaving.channel))
  private val light     = Mux(texel.isLight, Fill(NumberFormats.lightBits, 1.U(1.W)), inCube)
  private val lightThen = Reg(UInt(NumberFormats.lightBits.W))
  lightThen := light
  private val diffuse  = Rounding.saturate(reflected, colourBits)
  private val outgoing = leaving.emission.fold(diffuse)(emission => Rounding.saturate(diffuse +& emission, colourBits))
  private val kept     = Reg(Vec(3, UInt(colourBits.W))) // of a Fresnel reflection
  private val seen     = Reg(UInt(seenBits.W))
  seen := Mux(
    leaving.isIn(ColourPass.throughput),
    Rounding.narrow(reflected, weightBits),
    Mux(leaving.end.hasSurface, outgoing, beyond(leaving, light))
  )
  when(leaving.isValid && leaving.isIn(ColourPass.reflection)) { shiftIn(kept, outgoing) }

  // What the path shows of it, and still lets through
  private val weighed =
    after(leaving)(slot => slot.isValid := leaving.isValid && !leaving.isIn(ColourPass.reflection))
  private val weight =
    if (hasBounces)
      Mux(
        weighed.isIn(ColourPass.throughput),
        Mux(weighed.end.hasSurface, ofChannel(kept, weighed.channel), beyond(weighed, lightThen)),
        weighed.weight
      )
    else weighed.weight
  private val part = Reg(UInt(seenBits.W))
  part := drop(seen * weight, seenBits)

  // The path's colour so far. A surface that gathers has added its light before its throughput
  private val added   = after(weighed)(slot => slot.weight := weighed.weight - seen(weightBits - 1, 0))
  private val colours = Reg(Vec(3, UInt(colourBits.W)))
  private val weights = Reg(Vec(3, UInt(weightBits.W)))
  when(added.isValid) {
    when(!(added.isIn(ColourPass.throughput) && added.end.gathers)) {
      shiftIn(colours, Rounding.saturate(added.radiance +& part, colourBits))
    }
    shiftIn(weights, added.weight)
  }

  // A path's colour leaves, or waits for its ratio; or the path goes on
  private val done    = after(added)(slot => slot.isValid := added.isValid && added.isLast)
  private val ends    = done.isIn(ColourPass.end) && !done.goesBack
  private val isShown = done.isValid && ends && !done.needsRatio
  private val goesOn  = done.isValid && (done.end.gathers || done.goesBack)
  private val result  = Wire(new PathColour(config))
  result.context := done.context
  result.colour.channels.zip(colours).foreach { case (to, from) => to := from }
  result.ratio.foreach(_.channels.foreach(to => to := Fixed(to.format, one)))
  io.colour.valid            := isShown
  io.colour.bits             := result
  io.continued.valid         := goesOn
  io.continued.bits.context  := done.context
  io.continued.bits.goesBack := done.goesBack
  for (ratios <- ratios) {
    ratios.colour.valid := done.isValid && done.needsRatio
    ratios.colour.bits  := result
    ratios.result.ready := !isShown && !goesOn
    when(ratios.result.ready) {
      io.colour.valid := ratios.result.valid
      io.colour.bits  := ratios.result.bits
    }
  }

  // It enters the table; a read in the same cycle does not count
  isWriting := done.isValid && !ends
  for (table <- paths; bounce <- io.bounce; tint <- taken.tint) when(isWriting || (bounce.fire && isDirect)) {
    val path = Wire(new PathState)
    for ((to, (weight, tint)) <- path.throughput.zip(weights.zip(tint)))
      to := Fixed(to.format, Mux(isWriting, weight, tint.natural))
    path.radiance.channels.zip(colours).foreach { case (to, from) => to := Mux(isWriting, from, 0.U) }
    table.write(Mux(isWriting, done.context, bounce.bits.context), path)
  }
  isUpdating := Seq(slot, summed, sum, leaving, weighed, added, done, after(done)())
    .map(slot => slot.isValid && slot.isIn(ColourPass.throughput) && slot.context === next.context)
    .reduce(_ || _)

  private def takeEnd(end: PathTermination): Unit = {
    val isShadowed = end.occlusions.map(_ =/= Occlusion.none).reduce(_ || _)
    taken.context    := end.context
    taken.isBounce   := false.B
    taken.isStraight := end.isStraight.getOrElse(true.B)
    taken.end        := ShownEnd(config, end.end)
    taken.goesBack   := end.goesBack
    taken.occlusions := end.occlusions
    taken.needsRatio := taken.end.hasGathered || (PathEnd.is(config, end.end, PathEnd.directView) && isShadowed)
    taken.fresnel.foreach(_.raw := 0.U)
    for ((to, bounce) <- taken.tint.zip(io.bounce); (tint, albedo) <- to.zip(bounce.bits.albedo.channels))
      tint := Fixed(tint.format, Mux(bounce.bits.isTinted, tintOf(albedo), one)) // of a bounce, whatever is taken
  }

  private def takeBounce(bounce: BounceUpdate): Unit = {
    taken.context    := bounce.context
    taken.isBounce   := true.B
    taken.isStraight := bounce.isFirst
    taken.end        := ShownEnd(config, bounce.reflection)
    taken.goesBack   := false.B
    taken.needsRatio := false.B
    taken.occlusions.foreach(_ := Occlusion.none)
    taken.fresnel.foreach(_ := bounce.fresnel)
  }

  /** The path's first bounce, without a Fresnel reflection: its tint is the throughput. It needs no slot. */
  private def isTintOnly(bounce: DecoupledIO[BounceUpdate]): Bool =
    bounce.bits.isFirst && bounce.bits.fresnel.natural === 0.U

  /** A value of all ones is 1.0. */
  private def tintOf(albedo: UInt): UInt = albedo +& albedo(colourBits - 1)

  /** What a ray sees that meets no surface. */
  private def beyond(slot: ColourSlot, light: UInt): UInt = {
    val background = ofChannel(io.background.channels, slot.channel)
    if (hasCube) Mux(slot.end.isInCube, light, background) else background
  }

  private def ofChannel[T <: Data](channels: Seq[T], channel: UInt = schedule.channel): T =
    MuxLookup(channel, channels(2))(Seq(0.U -> channels(0), 1.U -> channels(1)))

  private def shiftIn(channels: Vec[UInt], value: UInt): Unit = channels := VecInit(channels.tail :+ value)

  private def drop(product: UInt, width: Int): UInt = Rounding.narrow(Rounding.floor(product, fraction), width)

  /** The slot, one stage later. */
  private def after(slot: ColourSlot)(change: ColourSlot => Unit = _ => ()): ColourSlot = {
    val now = WireInit(slot)
    change(now)
    val later = WireInit(RegNext(now))
    later.isValid := RegNext(now.isValid, false.B)
    later
  }
}

/** The surface at which a path ends. */
final private class TerminalSurface(config: PathConfig) extends Bundle {
  val albedo      = Rgb(FrameRegisters.colour)
  val directLight = Vec(config.device.frame.lights, Rgb(FrameRegisters.intensity))
  val emission    = if (config.device.frame.emission) Some(Rgb(FrameRegisters.colour)) else None
}

/** A path after its bounces so far. */
final private class PathState extends Bundle {
  val throughput = Vec(3, FrameRegisters.weight) // the weight of what the path still hits, by channel
  val radiance   = Rgb(FrameRegisters.colour)    // the colour so far
}
